"""Motions through joint positions: by raw bytes, and each limit by itself without a server."""

import time
from typing import Any

import numpy as np
import pytest
from fci.tests.conftest import errors_of

from pretouch.robot.description import fr3, panda
from pretouch.robot.model import RobotModel
from pretouch_fci.kinds import JointPosition
from pretouch_fci.limits import MotionLimits, motion_limits
from pretouch_fci.motion import Ending, Motion, Setpoint
from pretouch_fci.options import Drop
from pretouch_fci.wire import Controller, RobotKind

_MODELS = {"panda": RobotModel(panda()), "fr3": RobotModel(fr3())}
_READY = panda().q_ready
_MS = 1e-3
_REFLEX, _MOVE = 4, 2
_START = "joint_position_motion_generator_start_pose_invalid"


def _begun(client: Any) -> np.void:
    assert client.begin(generator=0) == "started"
    return client.first_of_motion()


def _moved(client: Any, by: float, milliseconds: int) -> np.void:
    """Move joints 1 and 7 by an angle [rad] smoothly and end; return the last state."""
    state = _begun(client)
    start, joints = state["q_d"].astype(np.float64), np.array([1, 0, 0, 0, 0, 0, 1])
    for k in range(1, milliseconds + 1):
        share = k / milliseconds
        q = start + joints * by * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
        state = client.turn(state, q, field="q_c")
        assert state["robot_mode"] == _MOVE, errors_of(state)
        np.testing.assert_allclose(state["q_d"], q, atol=1e-6)
    return client.turn(state, q, finished=True, field="q_c")


def test_the_arm_is_where_each_command_says_and_the_motion_ends(serve: Any, raw: Any, kind: RobotKind) -> None:
    client = raw(serve(kind))
    start = client.state()["q_d"]
    state = _moved(client, 0.3, 1000)
    assert client.ended() == "success"
    assert state["robot_mode"] != _REFLEX
    np.testing.assert_allclose(state["q_d"] - start, 0.3 * np.array([1, 0, 0, 0, 0, 0, 1]), atol=1e-6)
    after = client.state()
    np.testing.assert_allclose(after["q"], after["q_d"], atol=5e-3)


def test_lost_commands_are_bridged(serve: Any, raw: Any, kind: RobotKind) -> None:
    client = raw(serve(kind, drop=Drop(2, 50)))
    state = _begun(client)
    start = state["q_d"].astype(np.float64)
    for k in range(1, 2001):
        share = k / 2000
        q = start + 0.1 * (share - np.sin(2 * np.pi * share) / (2 * np.pi))
        state = client.turn(state, q, field="q_c")
        assert state["robot_mode"] == _MOVE, errors_of(state)
    np.testing.assert_allclose(state["q_d"], q, atol=1e-5)
    assert state["control_command_success_rate"] == pytest.approx(0.96)


@pytest.mark.parametrize("off", [0.2, 2e-3])
def test_the_first_position_must_be_where_the_arm_is(serve: Any, raw: Any, kind: RobotKind, off: float) -> None:
    client = raw(serve(kind))
    state = _begun(client)
    after = client.turn(state, state["q_d"] + off, field="q_c")
    assert client.ended() == "reflex"
    assert errors_of(after) == [_START]
    np.testing.assert_array_equal(after["q_d"], state["q_d"])


@pytest.mark.parametrize("off", [0.0, 1e-3, -2e-5])
def test_a_panda_begins_where_it_is_commanded_to_be_and_not_where_it_is(serve: Any, raw: Any, off: float) -> None:
    """The common mistake: to begin with q in place of q_d."""
    client = raw(serve("panda"))
    state = _begun(client)
    first = state["q_d"] + off if off else state["q"]
    assert errors_of(client.turn(state, first, field="q_c")) == [_START]


def test_an_fr3_may_begin_where_it_measurably_is(serve: Any, raw: Any) -> None:
    client = raw(serve("fr3"))
    state = _begun(client)
    q = state["q"].astype(np.float64)
    assert np.max(np.abs(q - state["q_d"])) > 2e-5  # farther than a millisecond goes
    state = client.turn(state, q, field="q_c")
    np.testing.assert_allclose(state["q_d"], q, atol=1e-6)
    np.testing.assert_array_equal(state["dq_d"], np.zeros(7))
    for k in range(1, 51):
        q = q + 1e-3 * k * _MS * np.eye(7)[6]
        state = client.turn(state, q, field="q_c")
        assert state["robot_mode"] == _MOVE, errors_of(state)


def test_a_step_of_the_positions_is_a_discontinuity(serve: Any, raw: Any, kind: RobotKind) -> None:
    client = raw(serve(kind))
    state = _begun(client)
    start = state["q_d"].astype(np.float64)
    state = client.turn(state, start, field="q_c")
    state = client.turn(state, start + 0.1 * np.eye(7)[0], field="q_c")
    assert client.ended() == "reflex"
    assert "joint_motion_generator_velocity_discontinuity" in errors_of(state)
    np.testing.assert_allclose(state["q_d"], start, atol=1e-6)


def test_a_motion_through_positions_may_not_end_while_it_moves(serve: Any, raw: Any) -> None:
    client = raw(serve())
    state = _begun(client)
    q = state["q_d"].astype(np.float64)
    for k in range(1, 51):
        q = q + 5e-3 * k * _MS * np.eye(7)[6]
        state = client.turn(state, q, field="q_c")
    state = client.turn(state, q, finished=True, field="q_c")
    assert client.ended() == "reflex"
    assert errors_of(state) == ["joint_motion_generator_velocity_discontinuity"]


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e308])
def test_positions_that_are_none_end_the_motion(serve: Any, raw: Any, bad: float) -> None:
    client = raw(serve())
    state = _begun(client)
    state = client.turn(state, state["q_d"], field="q_c")
    state = client.turn(state, np.full(7, bad), field="q_c")
    assert client.ended() in ("input error", "reflex")
    assert "joint_motion_generator_position_limits_violation" in errors_of(state)
    assert np.all(np.isfinite(state["q_d"]))


def test_in_real_time_the_first_states_of_a_motion_wait_for_their_answer_too(serve: Any, raw: Any) -> None:
    """libfranka filters the second command with what the robot took of the first, which must not be lost."""
    client = raw(serve("fr3", lockstep=False, grace_s=0.1))
    _begun(client)
    at = [time.monotonic()]
    for _ in range(30):
        client.state()
        at.append(time.monotonic())
    assert at[5] - at[0] > 0.4
    assert min(np.diff(at[6:])) < 0.1  # a client that loads its model first is not waited for


class Follower:
    """A motion of joint 7 alone that is always at the commanded position."""

    def __init__(self, kind: RobotKind, q: float) -> None:
        self.limits: MotionLimits = motion_limits(_MODELS[kind], kind)
        self.motion = Motion(self.limits, Controller.JOINT_IMPEDANCE, JointPosition(self.limits))
        self.q = _READY.copy()
        self.q[6] = q
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
        wanted = self.q + speed * _MS * np.eye(7)[6]
        ending = self.motion.follow(self.q, Setpoint(wanted))
        if ending is None:
            self.q = wanted
        return ending

    def go_on(self, speed: float) -> Ending:
        """Go on at a speed until that is refused."""
        while (ending := self.go(speed)) is None:
            pass
        return ending


def _reflex(name: str) -> Ending:
    return Ending("reflex", (f"joint_motion_generator_{name}",))


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_each_limit_of_a_motion_through_positions_has_its_own_name(kind: RobotKind) -> None:
    most = motion_limits(_MODELS[kind], kind)
    fast, hard, jerked = most.qd[6], most.qdd[6], most.qddd[6]
    # a little below each limit, then above it, with the others kept
    assert Follower(kind, 0.0).speed_up(0.98 * fast, 0.9 * hard) is None
    assert Follower(kind, 0.0).speed_up(1.01 * fast, 0.5 * hard) == _reflex("velocity_limits_violation")
    assert Follower(kind, 0.0).speed_up(0.5 * fast, 0.99 * hard) is None
    assert Follower(kind, 0.0).speed_up(0.5 * fast, 1.01 * hard) == _reflex("velocity_discontinuity")
    assert Follower(kind, 0.0).go(0.99 * jerked * _MS**2) is None
    assert Follower(kind, 0.0).go(1.01 * jerked * _MS**2) == _reflex("acceleration_discontinuity")


def test_a_position_beyond_the_end_of_a_joint_has_its_name() -> None:
    follower = Follower("panda", _MODELS["panda"].q_max[6] - 0.02)
    assert follower.speed_up(0.1, 1.0) is None
    assert follower.go_on(0.1) == _reflex("position_limits_violation")
    assert 0.0 <= follower.limits.q_max[6] - follower.q[6] < 0.1 * _MS


def test_towards_the_end_of_a_joint_the_fr3_must_be_slower() -> None:
    follower = Follower("fr3", _MODELS["fr3"].q_max[6] - 0.2)
    assert follower.speed_up(0.3, 1.0) is None
    assert follower.go_on(0.3) == _reflex("velocity_limits_violation")
