"""The vendor's own, unmodified clients against the server, in lockstep."""

import shutil

import numpy as np
import pytest
from tests.needs import skip_for

from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sim.tcp_push import TcpPush


def test_positions_lead_the_joints(serve, kind):
    done = serve(kind).ask("positions", 1.0)
    assert done["error"] is None
    assert done["after"]["mode"] == "idle"
    np.testing.assert_allclose(np.subtract(done["after"]["q_d"], done["told"][0]["q_d"]), 0.1, atol=1e-5)
    np.testing.assert_allclose(done["after"]["q"], done["after"]["q_d"], atol=5e-3)


def test_velocities_and_poses_lead_the_end_effector(serve, kind):
    by_velocities, by_poses = serve(kind).ask("cartesian", 1.0)
    assert by_velocities["error"] is by_poses["error"] is None
    first = np.array(by_velocities["told"][0]["O_T_EE_d"])
    there, back = (np.array(one["after"]["O_T_EE_d"]) for one in (by_velocities, by_poses))
    np.testing.assert_allclose(there - first, 0.1 * np.eye(16)[13], atol=3e-4)
    np.testing.assert_allclose(back - there, -0.1 * np.eye(16)[13], atol=1e-5)


def test_states_tell_poses_and_what_the_flange_carries(serve, kind):
    told, model = serve(kind).ask("state"), RobotModel(robot_named(kind))
    kin = model.kinematics(np.array(told["q"]))
    T = np.array(told["O_T_EE"]).reshape(4, 4).T
    np.testing.assert_allclose(T[:3, 3], kin.position[model.ee], atol=1e-6)
    np.testing.assert_allclose(T[:3, :3], kin.rotation[model.ee], atol=1e-6)
    # the hand's TCP is 0.1034 m before the flange, turned by -45 degrees about it
    half = np.sqrt(0.5)
    F_T_EE = np.array(told["F_T_EE"]).reshape(4, 4).T
    np.testing.assert_allclose(F_T_EE[:3], [[half, half, 0, 0], [-half, half, 0, 0], [0, 0, 1, 0.1034]], atol=1e-5)
    assert told["m_ee"] == pytest.approx(0.73)
    np.testing.assert_allclose(told["F_x_Cee"], [-0.01 * half, 0.01 * half, 0.03], atol=1e-5)
    assert told["mode"] == "idle"


def test_a_push_is_told_with_the_vendors_sign(serve, kind):
    force = (0.0, 15.0, -10.0)
    served = serve(kind, setup={"pushes": (TcpPush(0.3, force, 0.4),)})
    told = served.ask("hold", 1.0, 60.0)["told"]
    times = np.array([one["time"] for one in told]) - told[0]["time"]
    felt = np.array([one["O_F_ext_hat_K"] for one in told])
    K = np.array([one["K_F_ext_hat_K"] for one in told])
    before, during = (times > 0.1) & (times < 0.3), (times > 0.5) & (times < 0.7)
    came = felt[during].mean(axis=0) - felt[before].mean(axis=0)
    # by the robot on its environment: minus the force on the arm
    np.testing.assert_allclose(came[:3], np.negative(force), atol=1.5)
    np.testing.assert_allclose(np.linalg.norm(K[:, :3], axis=1), np.linalg.norm(felt[:, :3], axis=1), rtol=1e-5)
    torques = np.array([one["tau_ext_hat_filtered"] for one in told])
    model, q = RobotModel(robot_named(kind)), np.array(told[0]["q"])
    explained = model.ee_jacobian(model.kinematics(q))[:3].T @ np.negative(force)
    np.testing.assert_allclose(torques[during].mean(axis=0) - torques[before].mean(axis=0), explained, atol=0.6)


def test_a_contact_above_the_upper_threshold_is_a_reflex_and_recovery_works(serve, kind):
    served = serve(kind, setup={"pushes": (TcpPush(0.3, (0.0, 40.0, 0.0), 0.2),)})
    done = served.ask("hold", 1.0, 30.0)
    assert "cartesian_reflex" in done["error"]
    assert done["after"]["mode"] == "reflex"
    assert done["after"]["current_errors"] == done["after"]["last_motion_errors"] == ["cartesian_reflex"]
    assert done["after"]["cartesian_collision"] == [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    contact = [one["cartesian_contact"][1] for one in done["told"]]
    assert contact[0] == 0.0
    assert contact[-1] == 1.0
    assert done["recovered"]["mode"] == "idle"
    assert done["recovered"]["current_errors"] == []
    assert done["recovered"]["last_motion_errors"] == ["cartesian_reflex"]
    assert done["recovered"]["cartesian_collision"] == [0.0] * 6


def test_a_jump_of_the_velocity_is_refused_by_the_vendors_names(serve, kind):
    done = serve(kind).ask("move", 0.6, 0.3)
    names = [f"joint_motion_generator_{what}_discontinuity" for what in ("acceleration", "velocity")]
    assert all(name in done["error"] for name in names)
    assert done["after"]["last_motion_errors"] == names
    assert np.abs(done["after"]["dq_d"]).max() < 0.2
    assert done["recovered"]["mode"] == "idle"


def test_what_is_set_is_told(serve, kind):
    done = serve(kind).ask("settings")
    told = done["state"]
    assert told["m_load"] == 0.5
    np.testing.assert_allclose(told["F_x_Cload"], [0.0, 0.01, 0.02], atol=1e-8)
    np.testing.assert_allclose(told["I_load"], np.diag([1e-3, 2e-3, 3e-3]).reshape(-1), atol=1e-9)
    np.testing.assert_allclose(told["EE_T_K"], done["turned"], atol=1e-7)
    F_T_EE = np.array(told["F_T_EE"]).reshape(4, 4).T
    np.testing.assert_allclose(
        F_T_EE[:3, 3] - [0, 0, 0.1034], [0.03 * np.sqrt(0.5), 0.01 * np.sqrt(0.5), 0.03], atol=1e-5
    )
    assert "invalid argument" in done["refused"]["load"]
    assert "invalid argument" in done["refused"]["collision"]


def test_torques_hold_the_arm_as_their_springs_say(serve, kind):
    pushes = (TcpPush(0.5, (0.0, 12.0, 0.0), 2.0),)
    done = serve(kind, {"pushes": pushes}).ask("torques", 2.0)
    assert done["error"] is None
    last = done["told"][-1]
    moved = np.subtract(last["q"], done["begun"])
    # 12 N at 0.307 m from joint 1's axis, on 600 Nm/rad
    assert moved[0] == pytest.approx(12.0 * 0.307 / 600.0, abs=1e-3)
    np.testing.assert_allclose(last["tau_J_d"], -600.0 * moved, atol=1.5)
    assert done["after"]["mode"] == "idle"


@pytest.mark.parametrize(("client", "rough"), [("fr3", 1.0), ("panda", 1e-9), ("panda-python", 1e-9)])
def test_the_vendors_library_computes_with_our_model(serve, client, rough):
    kind = client.partition("-")[0]
    served = serve(kind)
    if kind == "panda" and shutil.which("cc") is None:
        skip_for("apt install gcc libc6-dev")
    told, model = served.ask("model", kind=client), RobotModel(robot_named(kind))
    q = np.array(told["q"])
    mass, gravity = model.mass_matrix_and_bias(q, np.zeros(7), np.zeros(7))
    np.testing.assert_allclose(np.reshape(told["gravity"], 7), gravity, atol=2e-2 * rough)
    np.testing.assert_allclose(np.reshape(told["mass"], (7, 7)), mass, atol=2e-3 * rough)
    jacobian = np.reshape(told["jacobian"], (6, 7), order="F")
    np.testing.assert_allclose(jacobian, model.ee_jacobian(model.kinematics(q)), atol=1e-5 * rough)


@pytest.mark.slow
def test_panda_pythons_own_motions_end_where_it_plans(serve):
    if shutil.which("cc") is None:
        skip_for("apt install gcc libc6-dev")
    told = serve("panda").ask("panda_python", kind="panda-python")
    assert told["done"] == [True, True]
    np.testing.assert_allclose(np.subtract(told["posture"], told["begun"]), 0.1, atol=2e-3)
    np.testing.assert_allclose(told["off"], 0.0, atol=1.5e-2)  # its springs are soft, and the joints have friction


@pytest.mark.parametrize(("client", "kind"), [("panda", "fr3"), ("fr3", "panda")])
def test_a_library_for_another_robot_is_told_so(serve, client, kind):
    error = serve(kind).ask("state", kind=client)["error"]
    assert "version" in error
    assert {"panda": "10", "fr3": "5"}[client] in error
