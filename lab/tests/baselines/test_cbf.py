"""Barrier functions: their distances and slopes against those of the robot model, and what they let through."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.needs import skip_without

from pretouch.control.interface import MotionBody
from pretouch.control.joint_box import joint_limits
from pretouch.params import TaskParams
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch_lab.baselines.cbf import CBF
from pretouch_lab.benchmarks.avoidance.obstacle import Ball, nearest


@pytest.fixture(scope="module")
def body():
    skip_without(CBF)
    model = RobotModel(panda())
    return MotionBody(model, 0, joint_limits(model, 0.01, 0.01), TaskParams())


@pytest.fixture(scope="module")
def safe(body):
    from pretouch_lab.baselines.cbf_barriers import SafetyFilter

    return SafetyFilter(body, 10.0)


def at(body, q, points=()):
    """Return what the filter is given at a posture: points, spreads, mass matrix and Jacobian."""
    from pretouch_lab.baselines.cbf_barriers import no_points

    place, spread = no_points()
    for i, point in enumerate(points):
        place[i], spread[i] = point, 0.05
    return place, spread, body.model.mass_matrix(q), body.model.ee_jacobian(body.model.kinematics(q))


def test_a_barrier_is_the_distance_from_the_body_less_the_points_spread(body):
    from pretouch_lab.baselines.cbf_barriers import VelocityBarriers

    rng, model = np.random.default_rng(0), body.model
    barriers = VelocityBarriers(body, 10.0)
    for _ in range(5):
        q, point = rng.uniform(model.q_min, model.q_max), rng.uniform(-0.8, 0.8, 3)
        h = np.asarray(barriers.h_1(q, *at(body, q, [point])))
        gaps = h[2 * model.n :].reshape(len(model.body), -1)
        truth = nearest(model.kinematics(q), model.body, Ball(point, 0.05))
        assert gaps[:, 0].min() == pytest.approx(truth.distance, abs=5e-4)  # the truth is sampled along the capsules
        assert gaps[:, 1:].min() > 90.0
        assert_allclose(h[:7], body.limits.q_max - q)
        assert_allclose(h[7:14], q - body.limits.q_min)


def test_what_is_far_from_everything_passes(body, safe):
    q, qd = body.model.description.q_ready, np.array([0.1, -0.2, 0.3, 0.0, 0.2, -0.1, 0.1])
    assert_allclose(safe(q, qd, *at(body, q)), qd, atol=1e-4)


def test_an_approach_is_as_fast_as_the_barrier_allows(body, safe):
    q, model = body.model.description.q_ready, body.model
    kin = model.kinematics(q)
    hand = model.body.of_links(np.array([model.link_index("panda_hand")]))
    at_hand = nearest(kin, hand, Ball(kin.position[model.ee] + [0.3, 0.0, 0.0], 0.05))
    point = at_hand.point + 0.07 * at_hand.direction  # 2 cm from what lies within the spread of 5 cm
    J = model.jacobian(kin, at_hand.link, at_hand.point)[:3]
    wanted = np.linalg.pinv(J) @ (1.0 * at_hand.direction)
    got = safe(q, wanted, *at(body, q, [point]))
    assert at_hand.direction @ J @ got <= 10.0 * 0.02 + 2e-3
    assert at_hand.direction @ J @ got > 0.1


def test_a_joint_stops_at_its_limit(body, safe):
    q = body.model.description.q_ready.copy()
    q[0] = body.limits.q_max[0] - 0.01
    got = safe(q, np.array([2.0, 0, 0, 0, 0, 0, 0]), *at(body, q))
    assert got[0] <= 10.0 * 0.01 + 1e-3
