"""Names and times as the standard topics have them."""

import re

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from pretouch.recording.standard import nanoseconds, topic_name


@given(st.floats(), st.integers(0, 10**18))
def test_any_stamp_is_a_time_that_ros_and_mcap_can_hold(stamp, instead):
    time = nanoseconds(stamp, instead)
    assert 0 <= time // 10**9 < 2**31
    if 0 <= stamp < 1e6:
        assert abs(time - stamp * 1e9) <= 1
    if np.isnan(stamp):
        assert time == instead


@given(st.text(min_size=1))
def test_any_unit_has_a_topic_that_ros_allows(name):
    assert re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", topic_name(name))
    assert topic_name("hand_left") == "hand_left"
