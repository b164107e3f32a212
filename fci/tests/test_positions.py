"""Motions through joint positions: by raw bytes, and each limit by itself without a server."""

import time

import numpy as np
import pytest
from fci.tests.conftest import errors_of, smooth

from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch_fci.kinds import JointPosition
from pretouch_fci.limits import MotionLimits, motion_limits
from pretouch_fci.motion import Ending, Motion, Setpoint
from pretouch_fci.options import Drop
from pretouch_fci.wire import Controller, RobotKind

_MS = 1e-3
_JOINT_7 = np.eye(7)[6]


@pytest.mark.parametrize(("drop", "rate", "off"), [(None, 1.0, 1e-6), (Drop(2, 50), 0.96, 1e-5)])
def test_the_arm_is_where_commands_say_though_some_are_lost(serve, raw, kind, drop, rate, off):
    client = raw(serve(kind, drop=drop))
    state = client.begun(0)
    start = state["q_d"].astype(np.float64)
    for k in range(1, 2001):
        q = start + 0.3 * smooth(k, 2000) * np.array([1, 0, 0, 0, 0, 0, 1])
        state = client.moved(state, q)
        if drop is None:
            np.testing.assert_allclose(state["q_d"], q, atol=off)
    np.testing.assert_allclose(state["q_d"], q, atol=off)
    assert state["control_command_success_rate"] == pytest.approx(rate)
    for _ in range(1 if drop is None else 3):  # the first two are lost
        state = client.turn(state, q, finished=True)
    assert client.ended() == "success"
    after = client.state()
    np.testing.assert_allclose(after["q"], after["q_d"], atol=5e-3)


@pytest.mark.parametrize(
    ("kind", "off"), [("panda", 0.2), ("panda", 1e-3), ("panda", -2e-5), ("panda", None), ("fr3", 0.2), ("fr3", 2e-3)]
)
def test_the_first_position_must_be_where_the_arm_is(serve, raw, kind, off):
    """Without an offset it is the common mistake: a Panda begins at q_d, and not at q."""
    client = raw(serve(kind))
    state = client.begun(0)
    after = client.turn(state, state["q"] if off is None else state["q_d"] + off)
    assert client.ended() == "reflex"
    assert errors_of(after) == ["joint_position_motion_generator_start_pose_invalid"]
    np.testing.assert_array_equal(after["q_d"], state["q_d"])


def test_an_fr3_may_begin_where_it_measurably_is(serve, raw):
    client = raw(serve("fr3"))
    state = client.begun(0)
    q = state["q"].astype(np.float64)
    assert np.max(np.abs(q - state["q_d"])) > 2e-5  # farther than a millisecond goes
    state = client.turn(state, q)
    np.testing.assert_allclose(state["q_d"], q, atol=1e-6)
    np.testing.assert_array_equal(state["dq_d"], np.zeros(7))
    for k in range(1, 51):
        q = q + 1e-3 * k * _MS * _JOINT_7
        state = client.moved(state, q)


def test_in_real_time_the_first_states_of_a_motion_wait_for_their_answer_too(serve, raw):
    """libfranka filters the second command with what the robot took of the first, which must not be lost."""
    client = raw(serve("fr3", lockstep=False, grace_s=0.1))
    client.begun(0)
    at = [time.monotonic()]
    for _ in range(30):
        client.state()
        at.append(time.monotonic())
    assert at[5] - at[0] > 0.4
    assert min(np.diff(at[6:])) < 0.1  # a client that loads its model first is not waited for


class Follower:
    """A motion of joint 7 alone that is always at the commanded position."""

    def __init__(self, kind: RobotKind, before_its_end: float | None = None) -> None:
        model = RobotModel(robot_named(kind))
        self.limits: MotionLimits = motion_limits(model, kind)
        self.motion = Motion(self.limits, Controller.JOINT_IMPEDANCE, JointPosition(self.limits))
        self.q = model.description.q_ready.copy()
        self.q[6] = 0.0 if before_its_end is None else self.limits.q_max[6] - before_its_end
        assert self.motion.follow(self.q, Setpoint(self.q)) is None

    def speed_up(self, to: float, rate: float) -> Ending | None:
        """Speed up to about a velocity [rad/s] at an acceleration [rad/s^2], reached at half the jerk limit."""
        speed = acceleration = 0.0
        rise = 0.5 * self.limits.qddd[6] * _MS
        while speed < to:
            acceleration = min(rate, acceleration + rise)
            speed += acceleration * _MS
            ending = self.go(speed)
            if ending is not None:
                return ending
        return None

    def go(self, speed: float) -> Ending | None:
        wanted = self.q + speed * _MS * _JOINT_7
        ending = self.motion.follow(self.q, Setpoint(wanted))
        if ending is None:
            self.q = wanted
        return ending


def _reflex(name: str) -> Ending:
    return Ending("reflex", (f"joint_motion_generator_{name}",))


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_each_limit_has_its_own_name(kind):
    most, q = Follower(kind).limits, Follower(kind).q
    fast, hard, jerked = most.qd[6], most.qdd[6], most.qddd[6]
    # a little below each limit, then above it, with the others kept
    assert Follower(kind).speed_up(0.98 * fast, 0.9 * hard) is None
    too_fast = 1.002 * fast * _JOINT_7
    assert most.violated(q, too_fast, np.zeros(7), too_fast) == _reflex("velocity_limits_violation").errors
    assert Follower(kind).speed_up(0.5 * fast, 0.99 * hard) is None
    assert Follower(kind).speed_up(0.5 * fast, 1.01 * hard) == _reflex("velocity_discontinuity")
    assert Follower(kind).go(0.99 * jerked * _MS**2) is None
    assert Follower(kind).go(1.01 * jerked * _MS**2) == _reflex("acceleration_discontinuity")


@pytest.mark.parametrize(
    ("kind", "way", "name"), [("panda", 0.02, "position_limits_violation"), ("fr3", 0.2, "velocity_limits_violation")]
)
def test_towards_the_end_of_a_joint_the_panda_goes_and_the_fr3_must_be_slower(kind, way, name):
    follower, speed = Follower(kind, way), {"panda": 0.1, "fr3": 0.3}[kind]
    assert follower.speed_up(speed, 1.0) is None
    while (ending := follower.go(speed)) is None:
        pass
    assert ending == _reflex(name)
    assert kind == "fr3" or 0.0 <= follower.limits.q_max[6] - follower.q[6] < speed * _MS
