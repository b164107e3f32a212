"""Faults in the robot's state: each is named, and nothing wrong is believed."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.faults import Watch, examine, not_finite, watch_init
from pretouch.modes import Event
from pretouch.params import FailureParams
from pretouch.sensing.unit import MIN_DISTANCE
from pretouch.types import Inputs, RangeReadings, RobotState

PARAMS = FailureParams()  # state older than 0.05 s, step more than 0.05 s after the last, no force for 0.2 s
PERIOD = 0.01
COMMAND = np.array([0.5, -0.2])
READINGS = RangeReadings(np.zeros(1), np.full(1, MIN_DISTANCE), np.zeros(1, np.int64))


def robot(stamp: float = 1.0) -> RobotState:
    return RobotState(
        stamp, np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.11, 0.21]), np.array([0.31, 0.41]),
        np.zeros(2), np.arange(6.0),
    )  # fmt: skip


def judge(inputs: Inputs, watch: Watch | None = None) -> tuple[RobotState, dict[Event, str], Watch]:
    return examine(watch or watch_init(robot()), inputs, COMMAND, PERIOD, PARAMS)


def inputs(stamp: float = 1.01, **change: object) -> Inputs:
    return Inputs(stamp, replace(robot(stamp), **change), READINGS)


def assert_last_state_moved_on(believed: RobotState) -> None:
    np.testing.assert_array_equal(believed.q, robot().q)
    # 0.11 + 0.5 * 0.01, 0.21 - 0.2 * 0.01
    np.testing.assert_allclose(believed.q_commanded, [0.115, 0.208])
    np.testing.assert_array_equal(believed.qd_commanded, COMMAND)
    assert believed.wrench is None


def test_a_good_state_is_believed():
    given = inputs()
    believed, faults, watch = judge(given)
    assert believed is given.robot
    assert faults == {}
    assert (watch.stamp, watch.force_stamp) == (1.01, 1.01)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("name", "called"),
    [
        ("q", "joint positions"),
        ("qd", "joint velocities"),
        ("q_commanded", "commanded joint positions"),
        ("qd_commanded", "commanded joint velocities"),
    ],
)
def test_a_number_that_is_not_finite_is_named_and_not_believed(name: str, called: str, value: float):
    believed, faults, watch = judge(inputs(**{name: np.array([0.0, value])}))
    assert faults == {Event.NOT_FINITE: called}
    assert_last_state_moved_on(believed)
    assert watch.robot is believed


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_time_stamp_that_is_not_finite_is_named(value: float):
    for wrong in (replace(inputs(), stamp=value), inputs(stamp=value), replace(inputs(), robot=robot(value))):
        believed, faults, watch = judge(wrong)
        assert faults == {Event.NOT_FINITE: "time stamps"}
        assert_last_state_moved_on(believed)
        assert np.isfinite(watch.stamp)


def test_the_believed_state_keeps_moving_on_while_nothing_is_heard():
    watch, believed = watch_init(robot()), robot()
    for i in range(1, 4):
        believed, _, watch = judge(inputs(1.0 + 0.01 * i, q=np.full(2, np.nan)), watch)
    np.testing.assert_allclose(believed.q_commanded, [0.11 + 3 * 0.005, 0.21 - 3 * 0.002])


@pytest.mark.parametrize(("age", "stale"), [(0.04, False), (0.06, True), (-0.04, False), (-0.06, True)])
def test_a_state_from_too_long_ago_or_from_the_future_is_stale(age: float, stale: bool):
    given = inputs(2.0)
    believed, faults, _ = judge(replace(given, robot=replace(given.robot, stamp=2.0 - age)))
    assert (Event.STATE_STALE in faults) == stale
    if stale:
        assert faults[Event.STATE_STALE] == f"{age:.3f} s"
        assert_last_state_moved_on(believed)


def test_time_that_goes_backwards_is_a_fault_once():
    _, _, watch = judge(inputs(5.0))
    believed, faults, watch = judge(inputs(4.9), watch)
    assert faults == {Event.TIME_BACKWARDS: "from 5.000 s to 4.900 s"}
    assert believed.wrench is None
    # from there on time runs forwards again
    _, faults, _ = judge(inputs(4.91), watch)
    assert faults == {}


@pytest.mark.parametrize(("gap", "overrun"), [(0.01, False), (0.049, False), (0.051, True), (0.4, True)])
def test_a_step_too_long_after_the_last_is_an_overrun(gap: float, overrun: bool):
    given = inputs(1.0 + gap)
    believed, faults, watch = judge(given)
    assert faults == ({Event.OVERRUN: f"{gap:.3f} s"} if overrun else {})
    # the state itself is good
    assert believed is given.robot
    # and with the next step in time all is well
    assert judge(inputs(1.01 + gap), watch)[1] == {}


def test_the_first_part_that_is_not_finite_is_named():
    wrong = np.array([np.nan, 0.0])
    assert not_finite(robot()) == ""
    assert not_finite(robot(np.inf)) == "time stamps"
    assert not_finite(replace(robot(), qd=wrong, q_commanded=wrong)) == "joint velocities"
    # a force is judged apart
    assert not_finite(replace(robot(), wrench=np.full(6, np.nan), tau_ext=wrong)) == ""


def test_the_same_instant_twice_is_no_fault():
    _, _, watch = judge(inputs(5.0))
    assert judge(inputs(5.0), watch)[1] == {}


@pytest.mark.parametrize(
    "wrench", [None, np.array([0, np.nan, 0, 0, 0, 0]), np.full(6, np.inf), np.array([0, 0, -1e150, 0, 0, 0])]
)
def test_a_missing_wrench_is_a_fault_only_after_a_while(wrench: np.ndarray | None):
    watch = watch_init(robot())
    for i in range(1, 31):
        believed, faults, watch = judge(inputs(1.0 + 0.01 * i, wrench=wrench), watch)
        assert believed.wrench is None
        np.testing.assert_array_equal(believed.q, robot().q)
        assert (Event.NO_FORCE in faults) == (0.01 * i > 0.2 + 1e-9)
    assert faults[Event.NO_FORCE] == "0.30 s"
    assert judge(inputs(1.31), watch)[1] == {}


def test_a_clock_set_back_does_not_hide_a_missing_wrench():
    _, _, watch = judge(inputs(100.0))
    _, _, watch = judge(inputs(50.0, wrench=None), watch)
    _, faults, _ = judge(inputs(50.3, wrench=None), watch)
    assert Event.NO_FORCE in faults
