"""Torques of a client, the impedances beside them, loads, and guiding by hand: the arm alone, and by raw bytes."""

from dataclasses import replace

import numpy as np
import pytest
from fci.tests.conftest import arm_of, smooth
from hypothesis import given
from hypothesis import strategies as st

from pretouch.sim.tcp_push import TcpPush
from pretouch_fci.arm import ServedArm
from pretouch_fci.controllers import _critical
from pretouch_fci.frames import Inertial
from pretouch_fci.gripper import GripperObject
from pretouch_fci.motion import MotionEnding, Setpoint
from pretouch_fci.wire import ControllerMode, Generator, RobotMode

_ZERO = np.zeros(7)
_JOINT_7 = np.eye(7)[6]
_TORQUE_ONLY = {"panda": Generator.JOINT_VELOCITY, "fr3": Generator.NONE}


def _tried(arm: ServedArm | None = None) -> ServedArm:
    """An arm that torques act on."""
    arm = arm or arm_of()
    arm.begin(Generator.JOINT_VELOCITY, ControllerMode.EXTERNAL)
    return arm


def _commanded(arm: ServedArm, *torques: np.ndarray) -> MotionEnding | None:
    """Command torques, one a millisecond, until the motion ends."""
    endings = (arm.step(Setpoint(_ZERO, torques=tau)) for tau in torques)
    return next((ending for ending in endings if ending is not None), None)


def _still(arm: ServedArm, milliseconds: int) -> None:
    for _ in range(milliseconds):
        assert arm.step(Setpoint(_ZERO)) is None, arm.errors


def _settled(arm: ServedArm) -> None:
    while not arm.settled:
        arm.step(None)


def test_a_torque_accelerates_a_joint_as_its_inertia_says():
    arm = _tried()
    _commanded(arm, _ZERO)
    before = arm.plant.mj_data.qvel[:7].copy()
    assert _commanded(arm, *[0.9 * _JOINT_7] * 20) is None
    mass = arm.model.mass_matrix(arm.report.q) + arm.plant.params.armature_kg_m2 * np.eye(7)
    gained = np.linalg.solve(mass, 0.9 * _JOINT_7) * 0.02
    moved = arm.plant.mj_data.qvel[:7] - before
    # friction of joint 7 takes up to 0.13 of 0.9 Nm at 0.1 rad/s: F1 / (1 + exp(-F2 (qd + F3))), less its value at rest
    assert 0.8 * gained[6] < moved[6] < gained[6]
    np.testing.assert_array_equal(arm.torques.desired, 0.9 * _JOINT_7)


def test_torques_alone_move_the_joints_and_after_them_the_arm_brakes_and_stays():
    arm = _tried()
    asked = arm.report.q_commanded.copy()
    _commanded(arm, *[0.9 * _JOINT_7] * 200)
    speed, there = arm.report.qd[6], arm.report.q[6]
    np.testing.assert_array_equal(arm.report.q_commanded, asked)
    assert there > asked[6] + 0.05
    assert arm.step(Setpoint(_ZERO, finished=True)) == MotionEnding("success")
    _settled(arm)
    # half a v^2 / a at 20 rad/s^2, and what the impedance swings
    assert arm.report.q[6] == pytest.approx(there + 0.5 * speed**2 / 20.0, abs=0.02)
    assert abs(arm.report.q_commanded[6] - arm.report.q[6]) < 1e-3
    assert arm.mode is RobotMode.IDLE


def test_torques_that_jump_or_are_too_large_are_refused():
    ramp = [k * _JOINT_7 for k in range(1, 12)]
    assert _commanded(_tried(), *ramp, 13.2 * _JOINT_7) == MotionEnding("reflex", (
        "controller_torque_discontinuity", "tau_j_range_violation",
    ))  # fmt: skip
    assert _commanded(_tried(), 2.0 * _JOINT_7) == MotionEnding("reflex", ("controller_torque_discontinuity",))
    assert _commanded(_tried(), *ramp, 12.001 * _JOINT_7) == MotionEnding("reflex", ("tau_j_range_violation",))
    assert _commanded(_tried(), np.full(7, np.nan)) == MotionEnding("input error", ("controller_torque_discontinuity",))
    assert _commanded(_tried(), np.full(7, 1e308)).errors[0] == "controller_torque_discontinuity"


def test_torques_that_drive_a_joint_too_fast_or_too_far_end_in_a_reflex():
    assert _commanded(_tried(), *[k * _JOINT_7 for k in range(1, 6)], *[6.0 * _JOINT_7] * 400) == MotionEnding(
        "reflex", ("joint_velocity_violation",)
    )
    model = arm_of().model
    ready = model.description.q_ready.copy()
    ready[6] = model.q_max[6] - 0.02
    arm = _tried(arm_of(q=ready))
    ending = _commanded(arm, *[0.9 * _JOINT_7] * 2000)
    assert ending == MotionEnding("reflex", ("joint_position_limits_violation",))
    arm.recover()
    _settled(arm)
    assert _commanded(_tried(arm), *[max(-0.9, -0.1 * k) * _JOINT_7 for k in range(200)]) is None, "it may go back"
    assert arm.report.q[6] < arm.model.q_max[6] - 0.02


def test_a_lost_command_leaves_the_torques_as_they_are():
    arm = _tried()
    _commanded(arm, 0.9 * _JOINT_7)
    for _ in range(19):
        assert arm.step(None) is None
        np.testing.assert_array_equal(arm.torques.desired, 0.9 * _JOINT_7)
    assert arm.step(None) == MotionEnding("reflex", ("communication_constraints_violation",))


def test_each_protocol_serves_torques_alone_and_beside_a_motion(serve, raw, kind):
    client = raw(serve(kind))
    for generator in (_TORQUE_ONLY[kind], Generator.JOINT_POSITION):
        state = client.begun(generator, ControllerMode.EXTERNAL)
        assert (state["controller_mode"], state["motion_generator_mode"]) == (ControllerMode.EXTERNAL, generator + 1)
        still = state["q_d"] if generator == Generator.JOINT_POSITION else 0.0
        for k in range(1, 50):
            state = client.turn(state, still, tau_J_d=0.01 * k * _JOINT_7)
        np.testing.assert_allclose(state["tau_J_d"], 0.49 * _JOINT_7, atol=1e-7)
        client.turn(state, still, finished=True)
        assert client.ended() == "success"


@pytest.mark.parametrize("frame", ["base", "turned"])
def test_a_push_moves_the_end_effector_as_the_cartesian_stiffness_says(frame):
    arm = arm_of(pushes=(TcpPush(0.2, (0.0, 12.0, 0.0), 1.5),))
    soft = np.array([1000.0, 300.0, 1000.0, 100.0, 100.0, 100.0])
    if frame == "turned":  # a quarter about the end-effector's own z: its x lies along the base's y
        R = arm.body.end_effector(arm.report.q)[0][:3, :3]
        arm.frames.EE_T_K = np.block([[R.T, np.zeros((3, 1))], [np.zeros((1, 3)), np.eye(1)]])
    arm.cartesian_stiffness = soft
    arm.begin(Generator.JOINT_VELOCITY, ControllerMode.CARTESIAN_IMPEDANCE)
    _still(arm, 150)
    before = arm.body.end_effector(arm.report.q)[0][:3, 3]
    _still(arm, 1300)
    moved = arm.body.end_effector(arm.report.q)[0][:3, 3] - before
    # 12 N on 300 N/m
    assert moved[1] == pytest.approx(0.04, abs=0.004)
    assert np.abs(moved[[0, 2]]).max() < 0.006


def test_a_push_moves_the_joints_as_their_stiffness_says():
    arm = arm_of(pushes=(TcpPush(0.2, (0.0, 12.0, 0.0), 1.5),))
    arm.plant.set_stiffness(np.full(7, 200.0))
    arm.begin(Generator.JOINT_VELOCITY, ControllerMode.JOINT_IMPEDANCE)
    _still(arm, 150)
    before = arm.report.q
    _still(arm, 1300)
    wanted = arm.body.end_effector(before)[1][:3].T @ [0.0, 12.0, 0.0] / 200.0
    np.testing.assert_allclose(arm.report.q - before, wanted, atol=0.1 * np.abs(wanted).max())


@given(st.integers(0, 2**32 - 1))
def test_each_mode_of_any_arm_is_damped_critically(seed):
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(2, 7, 7))
    M, K = A @ A.T + np.eye(7), B @ B.T
    # critically damped: M s^2 + D s + K has each of its roots twice, so its eigenvalues are real
    D = _critical(M, K)
    state = np.block([[np.zeros((7, 7)), np.eye(7)], [-np.linalg.solve(M, K), -np.linalg.solve(M, D)]])
    roots = np.linalg.eigvals(state)
    assert np.abs(roots.imag).max() < 1e-4 * np.abs(roots).max()
    assert roots.real.max() < 1e-6


def test_a_load_that_is_announced_is_no_external_force():
    found = {}
    for announced in (0.0, 2.0):
        arm = arm_of(object=GripperObject(0.04, 2.0))
        if announced:
            arm.announce(Inertial(announced, np.array([0.0, 0.0, 0.1034]), 1e-5 * np.eye(3)))
        arm.carry(replace(arm.gripper, width=0.04, grasped=True))
        _settled(arm)
        found[announced] = np.mean([arm.step(None) or arm.report.wrench[2] for _ in range(200)])
    assert found[0.0] - found[2.0] == pytest.approx(-2.0 * 9.81, rel=0.03)
    assert abs(found[2.0]) < 5.0


def test_the_load_is_where_the_client_says_until_it_has_gone():
    arm, load = arm_of(), Inertial(1.5, np.array([0.03, 0.02, 0.1]), np.diag([1e-3, 2e-3, 4e-3]))
    q, flange = arm.report.q, arm.frames.flange
    mass, gravity = arm.model.mass_matrix_and_bias(q, _ZERO, np.zeros(7))
    arm.announce(load)
    heavier, heavier_gravity = arm.model.mass_matrix_and_bias(q, _ZERO, np.zeros(7))
    kin = arm.model.kinematics(q)
    R = kin.rotation[flange]
    J = arm.model.jacobian(kin, flange, kin.position[flange] + R @ load.com)
    added = 1.5 * J[:3].T @ J[:3] + J[3:].T @ R @ load.inertia @ R.T @ J[3:]
    np.testing.assert_allclose(heavier - mass, added, atol=1e-9)
    np.testing.assert_allclose(heavier_gravity - gravity, 1.5 * 9.81 * J[2], atol=1e-9)
    arm.forget_settings()
    np.testing.assert_allclose(arm.model.mass_matrix_and_bias(q, _ZERO, np.zeros(7))[0], mass, atol=1e-12)


def test_guided_by_hand_the_arm_gives_way_along_the_free_axes_alone():
    arm = arm_of(pushes=(TcpPush(0.1, (0.0, 15.0, 15.0), 0.5),))
    arm.guiding_axes = np.array([False, True, False, False, False, False, True])
    arm.press_guiding()
    assert arm.mode is RobotMode.GUIDING
    before = arm.body.end_effector(arm.report.q)[0][:3, 3]
    _settled(arm)
    moved = arm.body.end_effector(arm.report.q)[0][:3, 3] - before
    # along the end-effector's y, which points along the base's -y; z is locked: 15 N on 3000 N/m
    assert moved[1] > 0.1
    assert np.abs(moved[[0, 2]]).max() < 0.02
    arm.press_guiding(False)
    assert arm.mode is RobotMode.IDLE
    _settled(arm)
    there = arm.report.q
    _still(_tried(arm), 1)
    np.testing.assert_allclose(arm.report.q, there, atol=1e-4)


def test_the_buttons_do_nothing_in_a_motion_and_the_user_stop_ends_guiding():
    arm = _tried()
    arm.press_guiding()
    assert arm.mode is RobotMode.MOVE
    arm = arm_of()
    arm.press_guiding()
    arm.press_stop()
    assert arm.mode is RobotMode.USER_STOPPED
    arm.press_guiding()
    assert arm.mode is RobotMode.USER_STOPPED
    arm.press_stop(False)
    assert arm.mode is RobotMode.IDLE


def test_while_it_is_guided_no_motion_begins(serve, raw, kind):
    served = serve(kind)
    served.arm.press_guiding()
    client = raw(served)
    assert client.request("SetGuidingMode", b"\1\0\0\0\0\0\1") == b"\0"
    assert served.arm.guiding_axes.tolist() == [True, False, False, False, False, False, True]
    assert client.begin() == "not possible"
    assert client.state()["robot_mode"] == RobotMode.GUIDING


def test_impedances_within_the_vendors_limits_act(serve, raw):
    served = serve("panda")
    client, arm = raw(served), served.arm
    before = arm.plant.stiffness.copy()
    for name, values, possible in (
        ("SetJointImpedance", np.full(7, 14250.0), True),
        ("SetJointImpedance", np.full(7, 14251.0), False),
        ("SetJointImpedance", -np.ones(7), False),
        ("SetCartesianImpedance", np.array([10.0, 10, 10, 1, 1, 1]), True),
        ("SetCartesianImpedance", np.array([10.0, 10, 9, 1, 1, 1]), False),
        ("SetCartesianImpedance", np.array([10.0, 10, 10, 1, 1, 301]), False),
    ):
        held = (arm.plant.stiffness.copy(), arm.cartesian_stiffness)[name == "SetCartesianImpedance"]
        assert client.request(name, values.tobytes()) == (b"\0" if possible else b"\2")
        now = (arm.plant.stiffness, arm.cartesian_stiffness)[name == "SetCartesianImpedance"]
        np.testing.assert_array_equal(now, values if possible else held)
    arm.forget_settings()
    np.testing.assert_array_equal(arm.plant.stiffness, before)


def test_an_arm_that_comes_into_itself_stops():
    arm = arm_of()
    arm.begin(Generator.JOINT_POSITION, ControllerMode.JOINT_IMPEDANCE)
    begun, folded = arm.report.q_commanded.copy(), np.array([0.0, 1.2, 0.0, -3.0, 0.0, 0.1, 0.785])
    k, ending = 0, None
    while ending is None:
        k += 1
        ending = arm.step(Setpoint(begun + smooth(k, 2000) * (folded - begun)))
    assert ending == MotionEnding("reflex", ("self_collision_avoidance_violation",))
    assert k < 2000
    _settled(arm)
    # back where it came from it may go
    arm.recover()
    arm.begin(Generator.JOINT_POSITION, ControllerMode.JOINT_IMPEDANCE)
    stopped = arm.report.q_commanded.copy()
    for k in range(2000):
        assert arm.step(Setpoint(stopped + smooth(k, 2000) * (begun - stopped))) is None, arm.errors
