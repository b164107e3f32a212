"""Link motions against finite differences of where points are."""

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


@pytest.mark.parametrize("link", ["panda_link1", "panda_link2", "panda_link5", "panda_link7", "panda_hand"])
def test_a_point_of_a_link_moves_as_its_motion_says(arm, panda_model, link):
    index, p, h = panda_model.link_index(link), np.array([0.03, -0.07, 0.11]), 1e-3
    motion = arm.link(index)

    def pose(time):
        kin = panda_model.kinematics(swing(panda_model, [time])[0][0])
        return kin.rotation[index], kin.position[index] + kin.rotation[index] @ p

    for i in np.flatnonzero(arm.usable)[::17]:
        (before, at, after) = (pose(arm.time[i] + dt) for dt in (-h, 0.0, h))
        R = at[0]
        acceleration = R.T @ (after[1] - 2 * at[1] + before[1]) / h**2
        turn = R.T @ (after[0] - before[0]) / (2 * h)
        assert motion.w[i] == pytest.approx([turn[2, 1], turn[0, 2], turn[1, 0]], abs=2e-3)
        assert motion.a[i] + motion.lever[i] @ p == pytest.approx(acceleration, abs=1e-2)
        assert motion.R_link_base[i] == pytest.approx(R.T, abs=1e-4)


def test_gaps_in_joint_positions_are_not_used(panda_model):
    time = np.arange(0, 8.0, 0.001)
    time = time[(time < 3.0) | (time > 3.4)]
    arm = ArmMotion(panda_model, JointTrace(time, swing(panda_model, time)[0]))
    assert not arm.usable[(arm.time > 2.75) & (arm.time < 3.65)].any()
    assert arm.usable[(arm.time > 2.0) & (arm.time < 2.7)].all()
    q = swing(panda_model, arm.time)[0]
    assert arm.q[arm.usable] == pytest.approx(q[arm.usable], abs=1e-3)
