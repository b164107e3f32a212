"""Link motions against MuJoCo's own velocities and accelerations, of joints whose derivatives are exact."""

import mujoco
import numpy as np
import pytest

from pretouch.calibration.link_motion import ArmMotion
from pretouch.traces import JointTrace

FREQUENCIES = np.array([0.3, 0.4, 0.5, 0.35, 0.7, 0.6, 0.9])


def swing(model, time):
    """Joint positions (T, n) and their two derivatives, from sines."""
    wt = 2 * np.pi * FREQUENCIES * np.asarray(time)[:, None] + np.arange(7)
    w = 2 * np.pi * FREQUENCIES
    amplitude = 0.3
    center = model.description.q_ready
    return center + amplitude * np.sin(wt), amplitude * w * np.cos(wt), -amplitude * w**2 * np.sin(wt)


@pytest.fixture(scope="module")
def arm(panda_model):
    time = 100.0 + np.arange(0, 6.0, 0.001)
    return ArmMotion(panda_model, JointTrace(time, swing(panda_model, time)[0]))


def test_near_the_ends_nothing_is_usable(arm):
    assert not arm.usable[arm.time < 100.25].any()
    assert not arm.usable[arm.time > 105.74].any()
    assert arm.usable[(arm.time > 100.27) & (arm.time < 105.72)].all()


def test_each_link_moves_as_by_mujoco(arm, panda_model):
    mj = mujoco.MjModel.from_xml_path(str(panda_model.description.mjcf))
    mj.opt.gravity[:] = 0.0
    data, point = mujoco.MjData(mj), np.array([0.03, -0.07, 0.11])
    for i in np.flatnonzero(arm.usable)[::17]:
        data.qpos[:], data.qvel[:], qdd = (x[0] for x in swing(panda_model, arm.time[i : i + 1]))
        mujoco.mj_fwdPosition(mj, data)
        mujoco.mj_fwdVelocity(mj, data)
        data.qacc[:] = qdd
        mujoco.mj_rnePostConstraint(mj, data)
        for link in range(1, mj.nbody):
            motion, velocity, acceleration = arm.link(link), np.zeros(6), np.zeros(6)
            mujoco.mj_objectVelocity(mj, data, mujoco.mjtObj.mjOBJ_XBODY, link, velocity, 1)
            mujoco.mj_objectAcceleration(mj, data, mujoco.mjtObj.mjOBJ_XBODY, link, acceleration, 1)
            w, (alpha, a) = velocity[:3], np.split(acceleration, 2)
            assert motion.w[i] == pytest.approx(w, abs=1e-4)
            there = a + np.cross(alpha, point) + np.cross(w, np.cross(w, point))
            assert motion.a[i] + motion.lever[i] @ point == pytest.approx(there, abs=1e-3)
            assert motion.R_link_base[i] == pytest.approx(data.xmat[link].reshape(3, 3).T, abs=1e-5)


def test_gaps_in_joint_positions_are_not_used(panda_model):
    time = np.arange(0, 8.0, 0.001)
    time = time[(time < 3.0) | (time > 3.4)]
    arm = ArmMotion(panda_model, JointTrace(time, swing(panda_model, time)[0]))
    assert not arm.usable[(arm.time > 2.75) & (arm.time < 3.65)].any()
    assert arm.usable[(arm.time > 2.0) & (arm.time < 2.7)].all()
    q = swing(panda_model, arm.time)[0]
    assert arm.q[arm.usable] == pytest.approx(q[arm.usable], abs=1e-3)
