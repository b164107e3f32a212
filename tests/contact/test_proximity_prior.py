"""How much nearness raises the prior."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.contact.hypotheses import nearest_of, nearness


def test_nearness_by_numbers():
    assert nearness(0.25, 0.0, 0.25, 0.2) == 0.0
    assert nearness(0.125, 0.0, 0.25, 0.2) == pytest.approx(0.5)
    # at 0.5 m/s it is 0.1 m nearer in 0.2 s
    assert nearness(0.225, 0.5, 0.25, 0.2) == pytest.approx(0.5)
    assert nearness(-0.02, 0.0, 0.25, 0.2) == 1.0


@given(st.floats(-0.1, 5.0), st.floats(-3.0, 3.0))
def test_nearness_is_bounded_and_going_away_never_lowers_it_below_standing(distance, closing):
    found = nearness(distance, closing, 0.25, 0.2)
    assert nearness(distance, 0.0, 0.25, 0.2) <= found <= 1.0


def test_the_nearest_objects_count():
    assert nearest_of(np.array([0.3, 0.1, 0.2]), 2).tolist() == [1, 2]
