import numpy as np
import pytest

from pretouch.calibration.motion.params import PlanParams
from pretouch.errors import ExperimentError
from pretouch_lab.studies.calibration.swings import watanabe_plan


@pytest.fixture(scope="module")
def plan(panda_model):
    return watanabe_plan(panda_model)


def test_the_arm_stands_a_second_in_each_of_twenty_postures(plan):
    assert len(plan.still) == 20
    assert all(end - begin == pytest.approx(1.0) for begin, end in plan.still)
    postures = np.array([plan.at(begin)[0] for begin, _ in plan.still])
    apart = np.linalg.norm(postures[:, None] - postures, axis=2) + 10 * np.eye(20)
    assert apart.min() > 0.2


def test_each_joint_swings_alone_and_twice(plan):
    moved = [np.flatnonzero(swing.amplitude.any(axis=0)).tolist() for swing in plan.swings]
    assert moved == [[joint] for joint in range(7)] * 2
    for swing in plan.swings:
        times = swing.begin + np.linspace(0.0, swing.duration, 50)
        q = np.array([plan.at(time)[0] for time in times])
        assert np.count_nonzero(np.ptp(q, axis=0) > 1e-9) == 1
        assert np.ptp(q, axis=0).max() > 0.05


def test_the_motion_begins_and_ends_at_rest_and_keeps_to_half_of_the_arms_limits(panda_model, plan):
    samples = plan.sampled(rate=500.0)
    q, step = samples.q, samples.time[1]
    qd, qdd = np.diff(q, axis=0) / step, np.diff(q, n=2, axis=0) / step**2
    arm = panda_model.description
    assert np.all(np.abs(qd).max(axis=0) <= 0.5 * arm.qd_max)
    assert np.all(np.abs(qdd).max(axis=0) <= 0.5 * arm.qdd_max)
    assert np.all((q >= panda_model.q_min + 0.1) & (q <= panda_model.q_max - 0.1))
    assert not qd[:20].any()
    assert np.abs(qd[-1]).max() < 1e-3
    assert q[0] == pytest.approx(q[-1])


def test_an_arm_without_room_is_told_so(panda_model):
    with pytest.raises(ExperimentError, match="of 20 postures were found"):
        watanabe_plan(panda_model, PlanParams(clearance_m=0.3))
