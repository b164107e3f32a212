"""Limits, motions, collisions, pushes and the URDF, without a server."""

from functools import partial
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest
from fci.tests.conftest import arm_of

from pretouch.errors import ParameterError, RobotModelError
from pretouch.robot.description import panda, robot_named
from pretouch.robot.model import RobotModel
from pretouch.sim.tcp_push import TcpPush
from pretouch_fci.collision import CollisionThresholds, Contacts
from pretouch_fci.frames import flange_of, urdf_of
from pretouch_fci.limits import motion_limits
from pretouch_fci.motion import Setpoint
from pretouch_fci.pushes import push_of
from pretouch_fci.server import drop_of
from pretouch_fci.state import StateDatagram, by_robot_at
from pretouch_fci.wire import PANDA, ControllerMode, Generator, RobotMode

_MODELS = {kind: RobotModel(robot_named(kind)) for kind in ("panda", "fr3")}
_LIMITS = {kind: motion_limits(model, kind) for kind, model in _MODELS.items()}
_READY = panda().q_ready
_ZERO = np.zeros(7)
_MIDDLE = np.array([0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.0])


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_each_limit_has_its_own_name(kind):
    limits, one = _LIMITS[kind], np.eye(7)[6]
    fast, hard, jerked = limits.qd[6], limits.qdd[6], limits.qddd[6]
    for factor, over in ((0.99, False), (1.01, True)):
        cases = {
            "velocity_limits_violation": (fast * factor, 0.0, fast * factor),
            "velocity_discontinuity": (0.0, hard, hard * factor * 1e-3),
            "acceleration_discontinuity": (0.0, 0.0, jerked * factor * 1e-6),
        }
        for name, (qd, qdd, wanted) in cases.items():
            errors = limits.violated(_MIDDLE, qd * one, qdd * one, wanted * one)
            assert errors == ((f"joint_motion_generator_{name}",) if over else ())


def test_towards_the_end_of_a_joint_the_panda_goes_until_there_and_may_come_back_from_beyond():
    limits, slow = _LIMITS["panda"], 0.1 * np.eye(7)[6]
    cases = (2e-4, slow, False), (5e-5, slow, True), (-0.01, slow, True), (-0.01, -slow, False)
    for before_its_end, qd, over in cases:
        q = _MIDDLE.copy()
        q[6] = limits.q_max[6] - before_its_end
        errors = limits.violated(q, qd, _ZERO, qd)
        assert errors == (("joint_motion_generator_position_limits_violation",) if over else ())


def test_the_fr3s_speed_limits_are_those_the_vendor_publishes():
    limits = _LIMITS["fr3"]
    q = _READY.copy()
    q[0] = 2.7
    # libfranka, rate_limiting.h: joint 1 towards its upper end
    most = min(2.62, max(0.0, -0.30 + np.sqrt(max(0.0, 12.0 * (2.75010 - q[0])))))
    for factor, fits in ((0.99, True), (1.02, False)):
        qd = np.eye(7)[0] * factor * most
        assert (limits.violated(q, qd, _ZERO, qd) == ()) == fits
        assert limits.violated(q, -qd, _ZERO, -qd) == ()


def test_a_motion_that_breaks_off_ends_in_braking_at_the_acceleration_limit():
    arm = arm_of()
    arm.begin(Generator.JOINT_VELOCITY, ControllerMode.JOINT_IMPEDANCE)
    for k in range(1, 501):
        assert arm.step(Setpoint(2e-3 * k * np.eye(7)[6])) is None
    assert arm.step(Setpoint(np.full(7, np.nan))) is not None
    speeds = [arm.qd[6]]
    while not arm.at_rest:
        arm.step(None)
        speeds.append(arm.qd[6])
    # 1 rad/s at 20 rad/s^2
    np.testing.assert_allclose(np.diff([1.0, *speeds])[:-1], -0.02, atol=1e-9)
    assert len(speeds) == 50
    assert arm.mode is RobotMode.REFLEX


def test_thresholds_are_those_of_what_the_arm_does():
    # lower and upper torque, accelerating then steady; then forces alike
    body = np.concatenate([np.repeat([10.0, 20.0, 1.0, 2.0], 7), np.repeat([30.0, 60.0, 3.0, 6.0], 6)])
    contacts = Contacts()
    contacts.behavior = CollisionThresholds.of(body)
    torque, force = 1.5 * np.eye(7)[2], -4.0 * np.eye(6)[0]
    assert contacts.update(torque, force, _ZERO) == ()
    assert contacts.joint_contact.tolist() == [False, False, True, False, False, False, False]
    assert contacts.cartesian_contact.tolist() == [True, False, False, False, False, False]
    assert contacts.update(5 * torque, 5 * force, np.ones(7)) == ()
    assert contacts.update(2 * torque, 2 * force, _ZERO) == ("cartesian_reflex", "joint_reflex")
    assert contacts.update(_ZERO, np.zeros(6), _ZERO) == ()
    assert contacts.joint_collision[2]
    contacts.forget()
    assert not contacts.joint_collision.any()


def test_pushes_and_drops_are_read():
    assert push_of("2.5:0,15,-3") == TcpPush(2.5, (0.0, 15.0, -3.0), 0.5)
    assert push_of("0:1,2,3:0.25") == TcpPush(0.0, (1.0, 2.0, 3.0), 0.25)
    assert (drop_of("3/50"), drop_of("")) == ((3, 50), (0, 1))


@pytest.mark.parametrize("read", [
    *[partial(push_of, text) for text in ("1:0,1e9,0", "1:0,0,-1001", "1", "1:2,3", "a:1,2,3", "1:1,2,3:0", "-1:1,2,3",
                                          "1:nan,0,0", "1:1,2,3:1:1")],
    *[partial(drop_of, text) for text in ("3", "3/", "0/50", "50/50", "-1/3", "a/b")],
])  # fmt: skip
def test_what_is_no_push_and_no_share_to_drop_is_refused(read):
    with pytest.raises(ParameterError, match=r"as 2\.0:0,15,0:0\.5|give at most 1000 N along each axis|as 3/50"):
        read()


@pytest.mark.parametrize("kind", ["panda", "fr3"])
def test_the_urdf_is_the_arm_up_to_its_flange(kind):
    model = _MODELS[kind]
    mj = mujoco.MjModel.from_xml_string(
        urdf_of(model).replace("<link", '<mujoco><compiler fusestatic="false"/></mujoco><link', 1)
    )
    data, flange = mujoco.MjData(mj), flange_of(model)
    rng = np.random.default_rng(0)
    for _ in range(5):
        q = rng.uniform(model.q_min, model.q_max)
        data.qpos[:] = q
        mujoco.mj_forward(mj, data)
        kin = model.kinematics(q)
        np.testing.assert_allclose(data.body("link8").xpos, kin.position[flange], atol=1e-6)
        np.testing.assert_allclose(data.body("link8").xmat.reshape(3, 3), kin.rotation[flange], atol=1e-6)
    ranges = mj.jnt_range
    envelope = model.description.envelope
    np.testing.assert_allclose(ranges[:, 1], model.q_max if envelope is None else envelope.q_upper)


def test_the_wrench_is_by_the_robot_and_about_the_stiffness_frame():
    # 10 N along y at a point 0.1 m in x from the frame: a moment of 1 Nm about z
    told = by_robot_at(np.array([0.0, 10.0, 0.0, 0.0, 0.0, 0.0]), np.array([0.1, 0.0, 0.0]), np.zeros(3))
    np.testing.assert_allclose(told, [0.0, -10.0, 0.0, 0.0, 0.0, -1.0])
    assert not np.signbit(by_robot_at(np.zeros(6), np.ones(3), np.zeros(3))).any()


def test_near_a_singularity_the_wrench_is_exactly_zero():
    q = np.array([0.0, 0.0, np.pi / 2, -0.07, 0.0, 3.2126, 0.0])
    arm = arm_of(q=q)
    assert arm.report.wrench is None
    state = np.frombuffer(StateDatagram(PANDA, arm).write(1), PANDA.state)[0]
    assert state["O_F_ext_hat_K"].tolist() == state["K_F_ext_hat_K"].tolist() == [0.0] * 6
    assert np.any(state["tau_ext_hat_filtered"])


def test_at_rest_the_torques_hold_the_arm():
    arm = arm_of()
    _, gravity = arm.model.mass_matrix_and_bias(arm.report.q, _ZERO, np.zeros(7))
    # but for what the model does not know of masses and payload
    np.testing.assert_allclose(arm.torques.measured, gravity, atol=3.0)
    np.testing.assert_allclose(arm.torques.desired, arm.torques.measured - gravity, atol=0.3)


def test_an_arm_with_other_joints_does_not_speak_it():
    six = SimpleNamespace(n=6, description=panda())
    with pytest.raises(RobotModelError, match="only arms with 7"):
        arm_of(model=six, q=_ZERO)
