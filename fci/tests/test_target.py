"""Targets that come now and then: how the joints get there."""

import struct
from typing import Any

import numpy as np
import pytest

from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch_fci.limits import motion_limits
from pretouch_fci.motion import FIRST_WITHIN, MotionEnding, Setpoint, TargetMotion
from pretouch_fci.wire import ControllerMode

_MODEL = RobotModel(robot_named("fr3"))
_LIMITS = motion_limits(_MODEL, "fr3")
_READY = _MODEL.description.q_ready
_MS = 1e-3


class Going:
    """An arm that does what it is told."""

    def __init__(self, fastest: float) -> None:
        self.motion = TargetMotion(_LIMITS, ControllerMode.JOINT_IMPEDANCE, np.full(7, fastest))
        self.q, self.courses = _READY.copy(), [_READY.copy()]

    def go(self, milliseconds: int, target: np.ndarray) -> None:
        """Have a target come at first, and then nothing."""
        setpoint = Setpoint(target)
        for _ in range(milliseconds):
            assert self.motion.follow(self.q, setpoint) is None
            self.q, setpoint = self.q + self.motion.qd * _MS, None
            self.courses.append(self.q)


@pytest.mark.parametrize(("fastest", "by"), [(0.2, 0.05), (0.655, 0.5), (100.0, 0.5), (100.0, 1e-3)])
def test_the_joints_arrive_within_all_limits_and_stay(fastest, by):
    """That no limit is broken, the motion itself sees; that the way is short, we do."""
    going = Going(fastest)
    target = _READY + by * np.array([1, -1, 1, -1, 1, -1, 1])
    going.go(1500, target)
    np.testing.assert_allclose(going.q, target, atol=1e-6)
    courses = np.array(going.courses)
    assert np.max(np.abs(np.diff(courses, axis=0))) <= min(fastest, float(np.max(_LIMITS.qd))) * _MS * (1 + 1e-9)
    beyond = (courses - target) * np.sign(target - _READY)
    assert np.max(beyond) < 1e-6
    arrived = np.argmax(np.all(np.abs(courses - target) < 1e-3, axis=1)) * _MS
    bang_bang = 2 * np.sqrt(by / float(np.min(_LIMITS.qdd)))
    assert arrived < 1.5 * bang_bang + by / min(fastest, float(np.min(_LIMITS.qd))) + 0.3


def test_a_target_that_changes_on_the_way_turns_the_joints_round():
    """As in the vendor's example: 0.25 rad to one side and to the other, in turns of a second, at 0.655 rad/s."""
    going = Going(0.655)
    for turn in range(6):
        going.go(1000, _READY + (-1) ** turn * 0.25)
    courses = np.array(going.courses)
    assert np.max(courses - _READY) == pytest.approx(0.25, abs=1e-3)
    assert np.min(courses - _READY) == pytest.approx(-0.25, abs=1e-3)


def test_it_ends_by_its_last_command_or_if_no_first_one_comes():
    going = Going(0.5)
    going.go(300, _READY + 0.5)
    assert np.min(going.motion.qd) > 0.4
    assert going.motion.follow(going.q, Setpoint(np.zeros(7), finished=True)) == MotionEnding("success")
    assert going.motion.follow(going.q, Setpoint(np.full(7, np.nan))) == MotionEnding(
        "input error", ("joint_motion_generator_position_limits_violation",)
    )
    silent = Going(0.5).motion
    endings = [silent.follow(_READY, None) for _ in range(FIRST_WITHIN)]
    assert endings[:-1] == [None] * (FIRST_WITHIN - 1)
    assert endings[-1] == MotionEnding("reflex", ("communication_constraints_violation",))


def _asked(client: Any, generator: int, fastest: float) -> str:
    """Ask for a motion whose way the robot finds."""
    body = struct.pack("<II6d?7d", 0, generator, *[0.0] * 6, True, *[fastest] * 7)
    return client.protocol.move[client.request("Move", body)[0]]


def test_a_client_sends_targets_when_it_likes(serve, raw):
    client = raw(serve("fr3"))
    assert _asked(client, 0, 0.5) == "started"
    state = client.first_of_motion()
    q = state["q_d"].astype(np.float64)
    for k in range(1, 6):  # every 40 ms, and each answers a state that is 3 ms old
        client.command(int(state["message_id"]), q + 0.02 * k)
        until = int(state["message_id"]) + 40
        state = client.state_where(lambda new, until=until: new["message_id"] >= until - 3)
        client.state_where(lambda new, until=until: new["message_id"] >= until)
    state = client.state_where(lambda new: abs(new["q_d"][0] - q[0] - 0.1) < 1e-4)
    np.testing.assert_allclose(state["q_d"], q + 0.1, atol=1e-3)
    assert state["control_command_success_rate"] == 1.0
    client.command(int(state["message_id"]), np.zeros(7), finished=True)
    assert client.ended() == "success"


@pytest.mark.parametrize(("generator", "fastest"), [(1, 0.5), (2, 0.5), (0, 0.0), (0, -1.0), (0, np.nan), (0, np.inf)])
def test_only_positions_of_joints_at_some_speed_can_be_targets(serve, raw, generator, fastest):
    assert _asked(raw(serve("fr3")), generator, fastest) == "not possible"
