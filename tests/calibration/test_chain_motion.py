"""Motion of links by recursion, against MuJoCo's own accelerations."""

import mujoco
import numpy as np
import pytest

from pretouch.calibration.link_motion import chain_motion, lever_acceleration
from pretouch.robot.model import RobotModel


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_point_of_each_link_accelerates_as_by_mujoco(panda_model: RobotModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = panda_model.description.q_ready + rng.uniform(-0.3, 0.3, panda_model.n)
    qd, qdd = rng.uniform(-1, 1, (2, panda_model.n))
    kin = panda_model.kinematics(q)
    w, alpha, a, point = (part[0] for part in chain_motion(kin.anchor[None], kin.axis[None], qd[None], qdd[None]))
    arm = mujoco.MjModel.from_xml_path(str(panda_model.description.mjcf))
    arm.opt.gravity[:] = 0.0
    data = mujoco.MjData(arm)
    data.qpos[:], data.qvel[:] = q, qd
    mujoco.mj_fwdPosition(arm, data)
    mujoco.mj_fwdVelocity(arm, data)
    data.qacc[:] = qdd
    mujoco.mj_rnePostConstraint(arm, data)
    for link in range(1, arm.nbody):
        k, found = int(panda_model.moved_by[link].sum()), np.zeros(6)
        mujoco.mj_objectAcceleration(arm, data, mujoco.mjtObj.mjOBJ_XBODY, link, found, 0)
        np.testing.assert_allclose(alpha[k], found[:3], atol=1e-9)
        place = lever_acceleration(w[k], alpha[k], kin.position[link] - point[k])
        np.testing.assert_allclose(a[k] + place, found[3:], atol=1e-9)


def test_a_point_that_turns_by_hand() -> None:
    w, alpha = np.array([0.0, 0.0, 2.0]), np.array([0.0, 0.0, 3.0])
    found = lever_acceleration(w, alpha, np.array([0.5, 0.0, 0.0]))
    assert found == pytest.approx([-4.0 * 0.5, 3.0 * 0.5, 0.0])
