"""Motions of the end-effector: by raw bytes, and each limit by itself without a server."""

from typing import Any

import numpy as np
import pytest
from fci.tests.conftest import errors_of, smooth

from pretouch.control.commander import rotation_about
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch_fci.cartesian import CARTESIAN_LIMITS, ArmBody, CartesianVelocity
from pretouch_fci.frames import frames_of
from pretouch_fci.limits import motion_limits
from pretouch_fci.motion import Motion, Setpoint
from pretouch_fci.wire import ControllerMode

_MS = 1e-3
_POSE, _VELOCITY = 2, 3
_PREFIX = "cartesian_motion_generator"
_START = "cartesian_position_motion_generator_start_pose_invalid"
_ZERO = np.zeros(7)


def _elbow(angle_and_sign: np.ndarray) -> dict[str, Any]:
    return {"valid_elbow": 1, "elbow_c": angle_and_sign}


def _pose(state: np.void) -> np.ndarray:
    return state["O_T_EE_d"].astype(np.float64).reshape(4, 4).T


def _columns(T: np.ndarray) -> np.ndarray:
    return T.T.ravel()


def test_velocities_lead_the_end_effector_and_are_told(serve, raw, kind):
    client = raw(serve(kind))
    state = begun = client.begun(_VELOCITY)
    for k in range(1, 1001):
        velocity = 0.1 * (1 - np.cos(2 * np.pi * k / 1000)) * np.array([0, 1, 0, 2, 0, 0])
        state = client.moved(state, velocity)
        np.testing.assert_allclose(state["O_dP_EE_c"], velocity, atol=1e-6)
    assert state["motion_generator_mode"] == _VELOCITY + 1
    client.turn(state, np.zeros(6), finished=True)
    assert client.ended() == "success"
    begin, end = _pose(begun), _pose(state)
    np.testing.assert_allclose(end[:3, 3] - begin[:3, 3], [0, 0.1, 0], atol=1e-5)
    np.testing.assert_allclose(end[:3, :3], rotation_about(np.eye(3)[0], 0.2) @ begin[:3, :3], atol=1e-5)


@pytest.mark.slow
def test_poses_lead_the_end_effector_though_commands_are_lost(serve, raw, kind):
    client = raw(serve(kind, drop="2/50"))
    state = client.begun(_POSE)
    T = begin = _pose(state)
    for k in range(1, 2001):
        T = begin.copy()
        T[2, 3] += 0.1 * smooth(k, 2000)
        T[:3, :3] = rotation_about(np.eye(3)[2], 0.3 * smooth(k, 2000)) @ begin[:3, :3]
        state = client.moved(state, _columns(T))
    np.testing.assert_allclose(_pose(state), T, atol=1e-5)
    assert state["control_command_success_rate"] == pytest.approx(0.96)
    for _ in range(3):  # the first two are lost
        state = client.turn(state, _columns(T), finished=True)
    assert client.ended() == "success"


def test_the_elbow_moves_while_the_end_effector_stays(serve, raw, kind):
    client = raw(serve(kind))
    state = begun = client.begun(_POSE)
    T, elbow = _pose(begun), begun["elbow_d"].astype(np.float64)
    for k in range(1, 1001):
        elbow[0] = begun["elbow_d"][0] + 0.2 * smooth(k, 1000)
        state = client.moved(state, _columns(T), **_elbow(elbow))
    assert state["q_d"][2] - begun["q_d"][2] == pytest.approx(0.2, abs=1e-5)
    np.testing.assert_allclose(_pose(state), T, atol=1e-6)
    # bent to the other side
    state = client.turn(state, _columns(T), **_elbow(elbow * [1, -1]))
    assert errors_of(state) == [f"{_PREFIX}_elbow_sign_inconsistent"]


@pytest.mark.parametrize(("by", "sign"), [(0.5, 1), (0.0, -1)])
def test_the_first_elbow_must_be_the_arms(serve, raw, kind, by, sign):
    client = raw(serve(kind))
    state = client.begun(_VELOCITY)
    elbow = _elbow((state["elbow_d"] + [by, 0]) * [1, sign])
    assert errors_of(client.turn(state, np.zeros(6), **elbow)) == [f"{_PREFIX}_start_elbow_invalid"]


@pytest.mark.parametrize("with_elbow", [True, False])
def test_an_fr3_may_begin_with_the_pose_it_measurably_has(serve, raw, with_elbow):
    client = raw(serve("fr3"))
    state = client.begun(_POSE)
    assert np.linalg.norm(state["O_T_EE"][12:15] - state["O_T_EE_c"][12:15]) > 2e-5
    first, angle = state["O_T_EE"].astype(np.float64), state["elbow"].astype(np.float64)
    for _ in range(3):
        state = client.moved(state, first, **(_elbow(angle) if with_elbow else {}))
    np.testing.assert_allclose(state["O_T_EE_c"], first, atol=1e-6)
    if with_elbow:
        assert state["q_d"][2] == pytest.approx(angle[0], abs=1e-6)


@pytest.mark.parametrize(("kind", "off"), [("panda", 0.1), ("panda", 1e-4), ("fr3", 0.1), ("fr3", 2e-3)])
def test_the_first_pose_must_be_where_the_arm_is(serve, raw, kind, off):
    client = raw(serve(kind))
    elsewhere, turned, half_turned = (_pose(client.state()) for _ in range(3))
    elsewhere[0, 3] += off
    turned[:3, :3] = rotation_about(np.eye(3)[0], off) @ turned[:3, :3]
    half_turned[:3, :3] = np.diag([1.0, -1.0, -1.0]) @ half_turned[:3, :3]
    for first in (elsewhere, turned, half_turned):
        assert errors_of(client.turn(client.begun(_POSE), _columns(first))) == [_START]
        assert client.ended() == "reflex"
        assert client.request("AutomaticErrorRecovery") == b"\0"


def test_no_motion_of_the_end_effector_begins_at_a_singularity(serve, raw, kind):
    q = np.array([0.0, 0.0, np.pi / 2, -0.15 if kind == "fr3" else -0.07, 0.0, 3.2126, 0.0])
    client = raw(serve(kind, setup={"q": q}))
    assert [client.begin(generator=generator) for generator in (_POSE, _VELOCITY)] == ["singular", "singular"]
    assert client.begin() == "started"


@pytest.mark.parametrize("kind", ["panda", "fr3"])
@pytest.mark.parametrize(("part", "axis"), [(0, 1), (1, 3), (2, 6)])
def test_each_limit_has_its_own_name(kind, part, axis):
    limits, one = CARTESIAN_LIMITS[kind], np.eye(7)[axis]
    fast, hard, jerked = (most[part] for most in (limits.velocity, limits.acceleration, limits.jerk))
    for factor, over in ((0.99, False), (1.01, True)):
        cases = {
            "velocity_limits_violation": (np.stack([fast * factor * one, _ZERO]), fast * factor),
            "velocity_discontinuity": (np.stack([_ZERO, hard * one]), hard * factor * _MS),
            "acceleration_discontinuity": (np.stack([_ZERO, _ZERO]), jerked * factor * _MS**2),
        }
        for name, (now, wanted) in cases.items():
            named = f"{_PREFIX}_{name if part < 2 else 'elbow_limit_violation'}"
            assert limits.violated(now, wanted * one) == ((named,) if over else ())


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_limits_of_joints_that_follow_have_names_of_their_own(kind):
    model = RobotModel(robot_named(kind))
    body = ArmBody(model, frames_of(model), CARTESIAN_LIMITS[kind])
    motion = Motion(motion_limits(model, kind), ControllerMode.JOINT_IMPEDANCE, CartesianVelocity(body))
    q, speed, acceleration, ending = model.description.q_ready.copy(), 0.0, 0.0, None
    while ending is None:  # until the arm is stretched
        acceleration = min(acceleration + 500.0 * _MS, 2.0) if speed < 0.4 else max(acceleration - 500.0 * _MS, 0.0)
        speed += acceleration * _MS
        ending = motion.follow(q, Setpoint(speed * np.eye(6)[0]))
        q += motion.qd * _MS
    assert ending.status == "reflex"
    assert any(name.startswith(f"{_PREFIX}_joint_velocity") for name in ending.errors), ending
