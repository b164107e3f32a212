"""Faults in what comes from outside: each is named, and nothing wrong is believed."""

from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

from pretouch.desired import twist
from pretouch.errors import ParameterError
from pretouch.faults import Watched, begin_watch, examine, robot_of
from pretouch.modes import Event
from pretouch.params import FailureParams
from pretouch.sensing.sensor import PAPER_SENSOR
from pretouch.sound import sound_points, sound_touch
from pretouch.types import Inputs, Payload, RangeReadings, Report, RobotState, SeenPoints, TouchReadings

PARAMS = FailureParams()  # state older than 0.05 s, step more than 0.05 s after the last, no force for 0.2 s
PERIOD = 0.01
QD_MAX = np.array([2.0, 2.0])
COMMAND = np.array([0.5, -0.2])
COMPLEX = np.full(2, 0.1 + 0.0j)
READINGS = RangeReadings(np.zeros(1), np.full(1, PAPER_SENSOR.nearest_m), np.zeros(1, np.int64))


def robot(stamp: float = 1.0) -> RobotState:
    return RobotState(
        stamp, np.array([0.1, 0.2]), np.array([0.3, 0.4]), np.array([0.11, 0.21]), np.array([0.31, 0.41]),
        np.zeros(2), np.arange(6.0),
    )  # fmt: skip


def watched(stamp: float = 1.0, room: int = 7) -> Watched:
    """What is remembered after a step at an instant with a good state, before any command was sent."""
    report = Report(np.zeros(1), *np.zeros((5, 2)), np.zeros(6))
    sent = np.zeros(1, np.int64), np.zeros(room), np.zeros((room, 2))
    begin_watch(watch := Watched(np.zeros(1), np.zeros(1), report, *sent), robot(stamp))
    return watch


def judge(inputs: Inputs, watch: Watched | None = None) -> tuple[RobotState, dict[Event, str], Watched]:
    watch = deepcopy(watch or watched())
    return *examine(watch, inputs, COMMAND, PERIOD, QD_MAX, PARAMS), watch


def inputs(stamp: float = 1.01, **change: object) -> Inputs:
    return Inputs(stamp, replace(robot(stamp), **change), READINGS)


def assert_same(believed: RobotState, given: RobotState) -> None:
    for name in ("stamp", "q", "qd", "q_commanded", "qd_commanded", "wrench"):
        np.testing.assert_array_equal(getattr(believed, name), getattr(given, name))


def assert_last_state_moved_on(believed: RobotState) -> None:
    np.testing.assert_array_equal(believed.q, robot().q)
    # 0.11 + 0.5 * 0.01, 0.21 - 0.2 * 0.01
    np.testing.assert_allclose(believed.q_commanded, [0.115, 0.208])
    np.testing.assert_array_equal(believed.qd_commanded, COMMAND)
    assert believed.wrench is None


def test_a_good_state_is_believed():
    given = inputs()
    believed, faults, watch = judge(given)
    assert_same(believed, given.robot)
    assert faults == {}
    assert (watch.stamp[0], watch.force_stamp[0]) == (1.01, 1.01)


def test_a_state_from_before_the_last_command_is_moved_on_by_it():
    # taken 8 ms before the last step, 18 ms before this one, in which the last command is taken to have held
    _, _, watch = judge(inputs(1.0))
    for stamp in (0.992, 1.0):
        given = inputs(1.01)
        believed, faults, _ = judge(replace(given, robot=replace(given.robot, stamp=stamp)), watch)
        assert faults == {}
        np.testing.assert_array_equal(believed.qd_commanded, COMMAND)
        np.testing.assert_allclose(believed.q_commanded, np.array([0.11, 0.21]) + COMMAND * (1.01 - stamp))
        np.testing.assert_array_equal(believed.q, robot().q)
    # one taken after the last step knows it
    given = inputs(1.01)
    believed, _, _ = judge(replace(given, robot=replace(given.robot, stamp=1.0001)), watch)
    np.testing.assert_array_equal(believed.qd_commanded, robot().qd_commanded)


@pytest.mark.parametrize(
    ("part", "said"),
    [
        *((np.array([0.0, value]), f"holds {value:g}, ") for value in (np.nan, np.inf, -np.inf, 1e3, -1e3, 1e300)),
        (np.zeros(3), "has the shape (3,), not (2,)"),
        (np.zeros((1, 2)), "has the shape (1, 2), not (2,)"),
        (0.5, "has the shape (), not (2,)"),
        (["a", "b"], "no array of numbers"),
        (None, "is None, no array of numbers"),
        (np.full(2, np.longdouble("1e4000")), "holds inf, "),
        (COMPLEX, "no array of numbers"),
        (COMPLEX.astype(object), "no array of numbers"),
    ],
)
@pytest.mark.parametrize("name", ["q", "qd", "q_commanded", "qd_commanded"])
def test_a_part_that_no_arm_can_have_is_named_and_not_believed(name: str, part: object, said: str):
    believed, faults, watch = judge(inputs(**{name: part}))
    assert list(faults) == [Event.UNUSABLE]
    assert faults[Event.UNUSABLE].startswith(f"RobotState.{name} ")
    assert said in faults[Event.UNUSABLE]
    assert_last_state_moved_on(believed)
    assert_last_state_moved_on(robot_of(watch.robot))


@pytest.mark.parametrize("wrench", [np.zeros(3), np.zeros((6, 1)), "none", [1.0, "x"], np.zeros(6, complex)])
def test_a_force_estimate_that_is_none_is_named(wrench: object):
    believed, faults, _ = judge(inputs(wrench=wrench))
    assert "RobotState.wrench" in faults[Event.UNUSABLE]
    assert_last_state_moved_on(believed)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e308, np.complex128(1.01), np.array(1.01 + 0j), 1.01 + 0j])
def test_a_time_stamp_that_is_none_is_named(value: object):
    for wrong in (replace(inputs(), stamp=value), inputs(stamp=value), replace(inputs(), robot=robot(value))):
        believed, faults, watch = judge(wrong)
        assert list(faults) == [Event.UNUSABLE]
        assert "stamp is " in faults[Event.UNUSABLE] or "stamp holds " in faults[Event.UNUSABLE]
        assert_last_state_moved_on(believed)
        assert np.isfinite(watch.stamp[0])


def test_the_believed_state_keeps_moving_on_while_nothing_is_heard():
    watch, believed = watched(), robot()
    for i in range(1, 4):
        believed, _, watch = judge(inputs(1.0 + 0.01 * i, q=np.full(2, np.nan)), watch)
    np.testing.assert_allclose(believed.q_commanded, [0.11 + 3 * 0.005, 0.21 - 3 * 0.002])


@pytest.mark.parametrize(("age", "stale"), [(0.04, False), (0.06, True), (-0.04, False), (-0.06, True)])
def test_a_state_from_too_long_ago_or_from_the_future_is_stale(age: float, stale: bool):
    given = inputs(2.0)
    believed, faults, _ = judge(replace(given, robot=replace(given.robot, stamp=2.0 - age)))
    assert (Event.STATE_STALE in faults) == stale
    if stale:
        old = (
            "0.060 s old, because this machine is busy, perhaps without a real-time kernel, or the connection is slow:"
            " close other programs and check the connection to the arm"
        )
        early = "0.060 s in the future: use one clock for states and steps"
        assert faults[Event.STATE_STALE] == (old if age > 0 else early)
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
    assert_same(believed, given.robot)
    # and with the next step in time all is well
    assert judge(inputs(1.01 + gap), watch)[1] == {}


def test_a_clock_set_back_is_seen_with_a_state_that_cannot_be_used_too():
    _, _, watch = judge(inputs(5.0))
    _, faults, watch = judge(inputs(4.0, q=np.full(2, np.nan)), watch)
    assert list(faults) == [Event.UNUSABLE, Event.TIME_BACKWARDS]
    assert watch.stamp[0] == 4.0


def test_what_was_sent_before_a_fault_is_not_forgotten():
    # sent from 1.00 to 1.01 s and, with a state that cannot be used, from 1.01 to 1.02 s; this report is from 1.00 s
    _, _, watch = judge(inputs(1.0))
    _, _, watch = judge(inputs(1.01, q=np.full(2, np.nan)), watch)
    given = inputs(1.02)
    believed, faults, _ = judge(replace(given, robot=replace(given.robot, stamp=1.0)), watch)
    assert faults == {}
    np.testing.assert_allclose(believed.q_commanded, np.array([0.11, 0.21]) + COMMAND * 0.02)


def test_the_same_instant_twice_is_no_fault_and_no_time():
    _, _, watch = judge(inputs(5.0))
    believed, faults, _ = judge(inputs(5.0), watch)
    assert faults == {}
    # the last command has not moved anything yet: what the robot reports still holds
    assert_same(believed, robot(5.0))


@pytest.mark.parametrize(
    "wrench", [None, np.array([0, np.nan, 0, 0, 0, 0]), np.full(6, np.inf), np.array([0, 0, -1e150, 0, 0, 0])]
)
def test_a_missing_wrench_is_a_fault_only_after_a_while(wrench: np.ndarray | None):
    watch = watched()
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


def test_complex_numbers_are_no_torque_touch_load_or_motion():
    believed, faults, _ = judge(inputs(tau_ext=COMPLEX))
    assert faults == {}
    assert np.isnan(believed.tau_ext).all()
    touch = TouchReadings(np.zeros(2), np.zeros(2, bool), COMPLEX, np.zeros(2, np.int64))
    assert "TouchReadings.force is array([0.1+0.j" in sound_touch(touch, 2)[1]
    points = SeenPoints(0.0, np.zeros(2), np.zeros((2, 3)), np.zeros(2))
    for name, part in {
        "heard": COMPLEX[0],
        "stamp": COMPLEX,
        "point": np.zeros((2, 3), complex),
        "sigma": COMPLEX,
    }.items():
        assert f"SeenPoints.{name} is" in sound_points(points._replace(**{name: part}))[1]
    with pytest.raises(ParameterError, match="is no payload: give numbers"):
        Payload(COMPLEX[0], (0.0, 0.0, 0.0))
    with pytest.raises(TypeError, match="complex128 are not real"):
        twist(1.0, np.zeros(3, complex))
