"""Bounds by physics on what a file says was learnt."""

import numpy as np
import pytest

from pretouch.contact.residual_model import residual_init
from pretouch.errors import ParameterError
from pretouch.params import SequentialParams
from pretouch.session.free_motion import check_learnt, kept, resumed

FRESH = residual_init(7, SequentialParams())


def changed(name, at, value):
    array = getattr(FRESH, name).copy()
    array[at] = value
    return FRESH._replace(**{name: array})


@pytest.mark.parametrize(
    ("name", "at", "possible", "impossible", "words"),
    [
        ("weights", (0, 0), -87.0, -87.1, "a weight of 87.1, beyond the 87"),  # the Panda's first joint gives 87 Nm
        ("weights", (6, 3), 12.0, 1e6, r"a weight of 1e\+06, beyond the 12"),
        ("weights", (0, 0), 0.0, np.nan, "a weight of nan"),
        ("weights", (2, 8), -1.0, -1.01, "a weight of 1.01, beyond the 1 "),
        ("weights", (0, 11), 17.0, 18.0, "a weight of 18, beyond the 17.4"),  # kg of the arm
        ("covariance", (6, 0, 0), 143.0, 1e6, "a variance of"),
        ("spread", (1, 1, 6), 143.0, 145.0, "a spread of 145, beyond the 144"),
        ("spread", (0, 0, 3), 9999.0, 1e6, "a spread of"),
    ],
)
def test_what_an_arm_can_have_learnt_is_bounded(panda_model, name, at, possible, impossible, words):
    check_learnt(FRESH, panda_model)
    check_learnt(changed(name, at, possible), panda_model)
    with pytest.raises(ParameterError, match=words):
        check_learnt(changed(name, at, impossible), panda_model)


def test_what_is_kept_comes_back():
    model = FRESH._replace(weights=FRESH.weights + 1.0, queue=FRESH.queue + 1.0, waiting=np.full(1, 3))
    back = resumed(kept(model), SequentialParams())
    assert np.all(back.weights == 1.0)
    assert back.waiting[0] == 0
    assert not back.queue.any()


@pytest.mark.parametrize(
    "change",
    [{"covariance": np.zeros((7, 12, 12))}, {"spread": -np.ones((2, 2, 7))}, {"weights": np.zeros((7, 3))}],
)
def test_what_cannot_have_been_learnt_is_refused(change):
    with pytest.raises(ParameterError, match="anew"):
        resumed(kept(FRESH) | change, SequentialParams())
