"""What somebody at a page asks of the arm: by a target, by keys, and when it no longer counts."""

import numpy as np
import pytest

from pretouch.desired import DesiredKind
from pretouch.errors import ParameterError
from pretouch.viewer.steering import KEYS_S, REACH_M, Steering, velocity_of

ALONG_X = np.array([0.5, 0.0, -3.0])


@pytest.mark.parametrize(
    ("keys", "look", "velocity"),
    [("100 0 0 7", ALONG_X, (0.3, 0.0, 0.0)),  # ahead is where somebody looks, on the level
     ("0 50 0 0", ALONG_X, (0.0, 0.15, 0.0)),
     ("0 0 -100 99", ALONG_X, (0.0, 0.0, -0.3)),
     ("100 0 0 1", np.array([0.0, -2.0, 0.0]), (0.0, -0.3, 0.0)),
     ("0 100 0 1", np.array([-1.0, 0.0, 0.0]), (0.0, -0.3, 0.0)),
     ("100 100 0 1", ALONG_X, (0.3 / np.sqrt(2.0), 0.3 / np.sqrt(2.0), 0.0)),
     ("999 0 0 1", ALONG_X, (0.3, 0.0, 0.0)),  # nobody is faster than the speed
     ("0 0 0 1", ALONG_X, (0.0, 0.0, 0.0))],
)  # fmt: skip
def test_keys_are_a_velocity_seen_from_where_somebody_looks(
    keys: str, look: np.ndarray, velocity: tuple[float, float, float]
) -> None:
    np.testing.assert_allclose(velocity_of(keys, look, 0.3), velocity, atol=1e-12)


@pytest.mark.parametrize(
    "keys", ["", "100 0 0", "1e9 0 0 1", "nan 0 0 1", "1000 0 0 1", "0 0 0 1 ", "0;0;0;1", "١ 0 0 x"]
)
def test_what_no_page_says_of_keys_is_refused(keys: str) -> None:
    with pytest.raises(ParameterError, match="The keys say"):
        velocity_of(keys, ALONG_X, 0.3)


def test_keys_count_until_they_are_no_longer_heard_of() -> None:
    steering = Steering()
    steering.held = True
    steering.push(np.array([0.1, 0.0, 0.0]), 5.0)
    for now, vx in ((5.01, 0.1), (5.0 + KEYS_S, 0.1), (5.01 + KEYS_S, 0.0)):
        asked = steering(now)
        assert (asked.kind, asked.stamp.tolist()) == (DesiredKind.TWIST, [now])
        assert asked.number[0].tolist() == [vx, 0.0, 0.0, 0.0, 0.0, 0.0]
    steering.push(np.array([0.1, 0.0, 0.0]), 5.0)
    assert not steering(0.2).number.any()  # the clock began anew


def test_a_target_counts_until_something_else_is_asked_and_lies_within_reach() -> None:
    steering = Steering()
    steering.held = True
    turned = np.diag([1.0, -1.0, -1.0])
    steering.target(np.array([0.5, -9.0, 0.3]), turned)
    for now in (1.0, 100.0):
        asked = steering(now)
        assert (asked.kind, asked.stamp.tolist()) == (DesiredKind.POSE, [now])
        assert asked.number[0].tolist() == [0.5, -REACH_M, 0.3, *turned.ravel()]
    steering.push(np.zeros(3), 100.0)
    assert steering.goal is None
    assert steering(100.0).kind is DesiredKind.TWIST


def test_what_is_asked_ages_while_who_asked_it_is_away() -> None:
    steering = Steering()
    steering.held = True
    steering(2.0)
    steering.held = False
    assert [float(steering(now).stamp[0]) for now in (2.5, 9.0)] == [2.0, 2.0]
    assert float(steering(0.3).stamp[0]) == 0.3  # after a reset it is of now at most, and ages from there
    assert float(steering(0.4).stamp[0]) == 0.3
