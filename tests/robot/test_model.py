"""A robot model: its kinematics and dynamics against MuJoCo, hand-computed numbers, and models that are refused."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from threading import Barrier

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from pretouch.errors import RobotModelError
from pretouch.importing.mounting import weights_of
from pretouch.robot.description import RobotDescription, fr3, panda
from pretouch.robot.model import RobotModel

postures = arrays(np.float64, 7, elements=st.floats(0.0, 1.0))
"""Joint positions as fractions of their range."""
velocities = arrays(np.float64, 7, elements=st.floats(-2.0, 2.0))
points = arrays(np.float64, 3, elements=st.floats(-0.5, 0.5))


def _q(model: RobotModel, fraction: np.ndarray) -> np.ndarray:
    return model.q_min + fraction * (model.q_max - model.q_min)


@pytest.fixture(scope="module", params=[panda, fr3], ids=lambda arm: arm.__name__)
def bare(request):
    """An arm, and the same MJCF for MuJoCo's own answers, without rotor inertia, damping and constraints."""
    model = mujoco.MjModel.from_xml_path(str(request.param().mjcf))
    model.dof_armature[:] = model.dof_damping[:] = 0.0
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    return RobotModel(request.param()), model, mujoco.MjData(model)


# Kinematics


def test_tcp_of_the_stretched_arm_adds_up_the_vendors_lengths(panda_model):
    kin = panda_model.kinematics(np.zeros(7))
    np.testing.assert_allclose(
        kin.position[panda_model.ee], [0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.107 - 0.1034], atol=1e-6
    )
    np.testing.assert_allclose(kin.rotation[panda_model.ee] @ [0, 0, 1], [0, 0, -1], atol=1e-5)


def test_tcp_of_the_ready_posture(panda_model):
    s = np.sqrt(0.5)  # upper arm leans back by 45 deg, forearm is level, hand points down
    x = s * (-0.316 + 0.0825) + 0.384 + 0.088
    z = 0.333 + s * (0.316 + 0.0825) + 0.0825 - 0.107 - 0.1034
    kin = panda_model.kinematics(panda().q_ready)
    np.testing.assert_allclose(kin.position[panda_model.ee], [x, 0.0, z], atol=1e-5)


TREE = """
<mujoco><compiler angle="radian"/><default><joint range="-3 3" limited="true"/><geom type="capsule" size=".02 .1"/>
</default><worldbody><body name="stand" pos=".1 -.2 .3" euler=".3 .2 -.5"><geom/>
  <body name="shoulder" pos="0 .1 .2" quat=".5 .1 -.7 .4">
    <joint name="a" axis="1 2 -1" pos=".03 .02 -.1"/><joint name="b" axis="0 1 0" pos="-.2 0 .1"/>
    <joint name="c" axis="0 -.6 .8" ref=".4"/><geom/>
    <body name="plate" pos=".3 0 .1" euler="1 0 .4"><geom/>
      <body name="tip" pos="0 0 .2" euler="0 -.7 .2"><joint name="d" pos="0 .05 0" ref="-1.1"/><geom/></body></body>
    <body name="other" pos="-.3 .1 0"><joint name="e" axis="1 0 0"/><geom/></body></body>
  <body name="lamp" pos="0 .4 0" euler="0 1 2"><joint name="f" axis="1 1 1" pos=".1 .1 .1"/><geom/></body></body>
</worldbody></mujoco>"""
"""Branches, a link without a joint, three joints on one link, axes off the origin, and zeros that are none."""


def tree(folder: Path) -> RobotDescription:
    (folder / "tree.xml").write_text(TREE)
    six = np.ones(6)
    return RobotDescription("tree", folder / "tree.xml", "tip", six, six, six, 0.0 * six, "made")


@pytest.mark.parametrize("arm", ["panda", "fr3", "tree"])
def test_kinematics_are_those_of_mujoco(arm: str, tmp_path: Path):
    description = {"panda": panda, "fr3": fr3, "tree": partial(tree, tmp_path)}[arm]()
    model, mj = RobotModel(description), mujoco.MjModel.from_xml_path(str(description.mjcf))
    data, rng = mujoco.MjData(mj), np.random.default_rng(5)
    for _ in range(200):
        data.qpos[:] = rng.uniform(-4.0, 4.0, model.n)
        mujoco.mj_kinematics(mj, data)
        kin = model.kinematics(data.qpos)
        for ours, theirs in zip(kin, (data.xpos, data.xmat, data.xanchor, data.xaxis), strict=True):
            np.testing.assert_allclose(ours, theirs.reshape(ours.shape), rtol=0, atol=1e-12)


def test_two_threads_may_ask_one_model_at_once(panda_model: RobotModel):
    postures = np.random.default_rng(8).uniform(panda_model.q_min, panda_model.q_max, (2000, 7))
    together = Barrier(2, timeout=60)

    def answers(order: slice) -> list[np.ndarray]:
        together.wait()
        rows = []
        for q in postures[order]:
            rows.append(np.vstack([panda_model.ee_jacobian(panda_model.kinematics(q)), panda_model.mass_matrix(q)]))
        return rows

    with ThreadPoolExecutor(2) as threads:
        forwards, backwards = threads.map(answers, (slice(None), slice(None, None, -1)))
    np.testing.assert_array_equal(forwards, backwards[::-1])
    for q, row in zip(postures, forwards, strict=True):
        np.testing.assert_array_equal(row[:6], panda_model.ee_jacobian(panda_model.kinematics(q)))


@pytest.mark.parametrize("q", [np.zeros(6), np.zeros(8), np.zeros((7, 1)), 0.0])
def test_joint_positions_of_another_number_are_refused(panda_model: RobotModel, q: np.ndarray):
    with pytest.raises(ValueError, match="give 7 of them"):
        panda_model.kinematics(q)


@given(q=arrays(np.float64, 7, elements=st.floats(-3.1, 4.6)))
def test_the_fr3_has_the_frames_and_the_body_of_a_panda(panda_model, fr3_model, q):
    assert fr3_model.links == tuple(name.replace("panda", "fr3") for name in panda_model.links)
    kin, same = fr3_model.kinematics(q), panda_model.kinematics(q)
    np.testing.assert_allclose(kin.position, same.position, atol=1e-12)
    np.testing.assert_allclose(kin.rotation, same.rotation, atol=1e-12)
    np.testing.assert_array_equal(fr3_model.moved_by, panda_model.moved_by)
    for part in ("link", "a", "b", "radius"):
        np.testing.assert_array_equal(getattr(fr3_model.capsules, part), getattr(panda_model.capsules, part))


@given(fraction=postures, link=st.integers(2, 11), p_link=points)
def test_jacobian_is_the_derivative_of_the_pose(panda_model, fraction, link, p_link):
    q = _q(panda_model, fraction)
    kin = panda_model.kinematics(q)
    jacobian = panda_model.jacobian(kin, link, kin.position[link] + kin.rotation[link] @ p_link)
    h = 1e-5
    for j, step in enumerate(h * np.eye(7)):
        ahead, behind = panda_model.kinematics(q + step), panda_model.kinematics(q - step)
        p_ahead = ahead.position[link] + ahead.rotation[link] @ p_link
        p_behind = behind.position[link] + behind.rotation[link] @ p_link
        turned = Rotation.from_matrix(ahead.rotation[link] @ behind.rotation[link].T).as_rotvec()
        np.testing.assert_allclose(jacobian[:3, j], (p_ahead - p_behind) / (2 * h), atol=1e-8)
        np.testing.assert_allclose(jacobian[3:, j], turned / (2 * h), atol=1e-8)


# Dynamics


@given(fraction=postures, qd=velocities, qdd=velocities)
def test_dynamics_are_the_inverse_dynamics_of_mujoco(bare, fraction, qd, qdd):
    arm, model, data = bare
    data.qpos[:], data.qvel[:], data.qacc[:] = _q(arm, fraction), qd, qdd
    mujoco.mj_inverse(model, data)
    mass_matrix, bias = arm.mass_matrix_and_bias(data.qpos, qd, np.zeros(7))
    np.testing.assert_allclose(mass_matrix @ qdd + bias, data.qfrc_inverse, atol=1e-9)
    np.testing.assert_allclose(arm.mass_matrix(data.qpos), mass_matrix, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("gravity", "shares"), [((0, 0, -1), (0, 1)), ((0, 0, 1), (0, -1)), ((0, 0.5, -(0.75**0.5)), (0.5, 0.75**0.5))]
)
def test_the_stretched_fr3_weighs_what_its_links_do_however_it_is_mounted(gravity, shares):
    # at zero all frames are turned about x alone: the shoulder carries each centre of mass with its x in the base
    masses = [2.9355370338, 2.2449013699, 2.6155955791, 2.3271207594, 1.8170376524, 0.6271432862, 0.73]
    x = [0.0031828864, 0.0407015686, 0.0825 - 0.0459100965, -0.0016039605, 0.0597131221, 0.088 + 0.0045225817]
    hand = 0.088 - 0.01 * np.cos(np.pi / 4)
    torque = -9.81 * np.dot(masses, [*x, hand])
    model = RobotModel(replace(fr3(), gravity=np.array(gravity)))
    # joint 1 turns about z, joint 2 about y: of a weight at x they carry the parts along y and along -z
    _, bias = model.mass_matrix_and_bias(*np.zeros((3, 7)))
    assert bias[:2] == pytest.approx(np.multiply(shares, torque), abs=1e-3)
    np.testing.assert_allclose(weights_of(model, np.zeros(7)) @ model.gravity, bias, atol=1e-9)
    np.testing.assert_allclose(model.mechanism.upright @ model.gravity, (0, 0, -9.81), atol=1e-9)


@pytest.mark.parametrize("disturbance", [1.0, np.nan, np.inf])
def test_answers_depend_on_the_arguments_alone(panda_model, disturbance):
    q, qd = panda().q_ready, np.linspace(-1, 1, 7)
    kin, dynamics = panda_model.kinematics(q), panda_model.mass_matrix_and_bias(q, qd, np.zeros(7))
    kept = kin.position.copy()
    panda_model.mass_matrix_and_bias(*np.full((2, 7), disturbance), np.zeros(7))
    panda_model.kinematics(np.full(7, disturbance))
    np.testing.assert_array_equal(kin.position, kept)  # what was handed out stays as it was
    np.testing.assert_array_equal(panda_model.kinematics(q).position, kept)
    for again, before in zip(panda_model.mass_matrix_and_bias(q, qd, np.zeros(7)), dynamics, strict=True):
        np.testing.assert_array_equal(again, before)


# Models that are refused


def test_an_unknown_link_or_end_effector_is_answered_with_those_there_are(panda_model):
    assert panda_model.links[panda_model.link_index("panda_link5")] == "panda_link5"
    with pytest.raises(RobotModelError, match=r"link 'elbow' is unknown: choose from panda_link0, .*panda_hand_tcp\."):
        panda_model.link_index("elbow")
    with pytest.raises(RobotModelError, match="link 'gripper' is unknown"):
        RobotModel(replace(panda(), ee_body="gripper"))


def _one_joint_arm(path: Path, joint: str, geom: str = '<geom type="capsule" size="0.1 0.2"/>') -> RobotModel:
    file = path / "arm.xml"
    file.write_text(
        f'<mujoco><worldbody><body name="tool"><joint name="pivot" {joint}/><inertial pos="0 0 0" mass="1"'
        f' diaginertia="1 1 1"/>{geom}</body></worldbody></mujoco>'
    )
    one = np.ones(1)
    return RobotModel(replace(panda(), mjcf=file, ee_body="tool", qd_max=one, qdd_max=one, tau_max=one, q_ready=one))


def test_an_arm_of_one_hinge_is_accepted(tmp_path):
    assert _one_joint_arm(tmp_path, 'range="-90 90"').q_max == pytest.approx(np.pi / 2)


@pytest.mark.parametrize(
    ("joint", "geom", "message"),
    [
        ('type="slide" range="-1 1"', '<geom type="capsule" size="0.1 0.2"/>', "joint pivot is not a hinge"),
        ("", '<geom type="capsule" size="0.1 0.2"/>', "joint pivot has no range: give it its position limits"),
        ('type="ball"', '<geom type="capsule" size="0.1 0.2"/>', "the MJCF has 3 joints, q_ready 1"),
        ('range="-90 90"', "", "no joint moves a capsule"),
        ('range="-90 90"', "<geom", "cannot be read"),
        ('range="-90 90"', "\n<geom/>", "cannot be read: .*geom"),
        ('range="-90 90"', 201 * '<geom type="capsule" size=".1 .1"/>', "move 201 capsules of"),
        ('range="-90 90"', '<geom type="capsule" size="900 900"/>', r"1 capsules of 2\.04e\+07 m\^2"),
    ],
)
def test_a_model_that_would_be_misunderstood_is_refused_in_one_sentence(tmp_path, joint, geom, message):
    with pytest.raises(RobotModelError, match=message) as caught:
        _one_joint_arm(tmp_path, joint, geom)
    assert "\n" not in str(caught.value)
