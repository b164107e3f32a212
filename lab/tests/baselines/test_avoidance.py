from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.control.motions import Mover

from pretouch.control.joint_box import joint_limits
from pretouch.errors import ParameterError
from pretouch.perception.closest import closest_points
from pretouch.profiles import profile
from pretouch.types import QpOutcome, RobotState, no_obstacles
from pretouch_lab.baselines.ding import Ding
from pretouch_lab.baselines.flacco import Flacco

FLACCO, DING = Flacco(), Ding()


def test_repulsion_by_numbers_is_finite_anywhere():
    # at half of rho the exponent is 0; at 0 it is -6, and 1 / (1 + e^-6) = 0.99752738; at rho it is 6
    speed = FLACCO.v_max_m_s * FLACCO.risk(np.array([0.0, 0.2, 0.4, 1e6, -1e6]))
    np.testing.assert_allclose(speed, [0.4 * 0.99752738, 0.2, 0.4 * 0.00247262, 0.0, 0.4], rtol=1e-5, atol=1e-12)


@pytest.mark.parametrize(
    ("points", "size", "expected"),
    [
        ([], 0.0, [0.0, 0.0, 0.0]),
        ([[0.0, 0.2, 0.0]], 0.0, [0.0, -0.2, 0.0]),
        ([[0.3, 0.0, 0.0]], 0.1, [-0.2, 0.0, 0.0]),
        ([[0.2, 0.0, 0.0], [0.0, 0.2, 0.0]], 0.0, [-0.2 / np.sqrt(2), -0.2 / np.sqrt(2), 0.0]),
        ([[0.2, 0.0, 0.0], [-0.2, 0.0, 0.0]], 0.0, [0.0, 0.0, 0.0]),
    ],
    ids=["nothing", "one point", "the hand's size is taken off", "size of the nearest, way of both", "both sides"],
)
def test_the_hand_is_moved_away_from_points(points, size, expected):
    points = np.array(points, float).reshape(-1, 3)
    far = np.linalg.norm(points, axis=1)
    obstacles = no_obstacles(len(points))._replace(point=points, ee_distance=far, body_distance=far)
    obstacles = obstacles._replace(link=np.ones(len(points), np.int64), direction=points / far[:, None])
    velocity = replace(FLACCO, size_m=size).velocity(np.zeros(3), obstacles)
    np.testing.assert_allclose(velocity, expected, atol=1e-12)


def test_joints_are_slowed_towards_obstacles_only_by_the_strictest_limit_of_several():
    lower, upper = FLACCO.slowed(np.array([[0.5, -0.1, 0.0]]), np.array([0.2]), np.array([2.0, 2.0, 2.0]))
    np.testing.assert_allclose(upper, [1.0, 2.0, 2.0])
    np.testing.assert_allclose(lower, [-2.0, -1.0, -2.0])
    motion, distance = np.array([[1.0, -1.0], [1.0, 1.0]]), np.array([0.2, 0.0])
    lower, upper = FLACCO.slowed(motion, distance, np.array([2.0, 2.0]))
    left = 2.0 * (1 - 0.99752738)
    np.testing.assert_allclose(upper, [left, left], rtol=1e-5)
    np.testing.assert_allclose(lower, [-2.0, -1.0])


def test_ding_limits_and_rows_by_numbers():
    distance = np.array([-0.1, 0.17, 0.195, 0.22, 0.24, 0.25, 0.275, 0.2999, 0.3, 2.0])
    expected = [-0.2, -0.2, -0.1, 0.0, 0.0, 0.0, 0.1, 0.1996, np.inf, np.inf]
    np.testing.assert_allclose(DING.limit(distance), expected, atol=1e-12)
    approach = np.array([[1.0, 0.0], [0.0, 1.0]])
    rows = DING.within(approach, np.array([0.2, 0.5]))
    assert rows.which.tolist() == [0]
    # w = 1/0.2 and 1/0.5
    np.testing.assert_allclose(rows.G, [[1.0, 0.0], [5.0 / 7.0, 2.0 / 7.0]])
    np.testing.assert_allclose(rows.h, [-0.08, 0.0])
    assert rows.weight > 0
    near = replace(DING, weighted_m=0.3).within(approach, np.array([0.2, 0.5]))
    np.testing.assert_allclose(near.G[-1], [1.0, 0.0])


@given(st.lists(st.floats(0.02, 1.0), min_size=1, max_size=5), st.integers(0, 10_000))
def test_no_motion_that_ding_allows_lowers_the_weighted_sum_of_the_distances(distance, seed):
    rng = np.random.default_rng(seed)
    d = np.array(distance)
    rows = DING.within(rng.standard_normal((len(d), 7)), d)
    qd = rng.standard_normal(7)
    allowed = qd - max(0.0, rows.G[-1] @ qd) / (rows.G[-1] @ rows.G[-1]) * rows.G[-1]
    C = -rows.G[-1]  # gradient of sum d_i / d_i(now)
    assert C @ allowed >= -1e-9


def test_distances_of_ding_have_to_grow():
    for wrong in ({"repulse_m": 0.3}, {"notice_m": 0.25}):
        with pytest.raises(ParameterError, match="they must grow"):
            Ding(**wrong)


class Arm:
    """A Panda at rest in its ready posture, with a point beside its hand."""

    def __init__(self, model, text, *offset):
        self.model, q, still = model, model.description.q_ready, np.zeros(7)
        self.kin, self.robot = model.kinematics(q), RobotState(0.0, q, still, q, still, still, None)
        self.limits = joint_limits(model, 0.01, 0.01)
        self.mover = Mover(model, profile(text))
        hand, k = self.kin.position[model.ee], len(offset)
        points, aside = hand + np.reshape(offset, (k, 3)), np.tile([0.0, 1.0, 0.0], (k, 1))
        self.obstacles = closest_points(self.kin, model.body, hand, np.zeros(k, np.int64), points, aside)

    def step(self, velocity, hold=False):
        goal = self.kin.rotation[self.model.ee]
        return self.mover.step(self.kin, self.robot, self.obstacles, np.array(velocity), goal, hold=hold)

    def move(self, velocity, hold=False):
        """Answer to a velocity once the acceleration box has let the arm get there."""
        for _ in range(60):
            motion = self.step(velocity, hold)
            self.robot = replace(self.robot, qd=motion.qp.qd, qd_commanded=motion.qp.qd)
        assert motion.qp.outcome is (QpOutcome.SKIPPED if hold else QpOutcome.SOLVED)
        return motion

    def hand(self, qd):
        """Velocity of the end-effector's origin."""
        return (self.model.ee_jacobian(self.kin) @ qd)[:3]

    def approach(self, qd):
        """Speed of the nearest point of the arm towards the one beside it."""
        near = self.obstacles
        return near.direction[0] @ self.model.jacobian(self.kin, int(near.link[0]), near.body_point[0])[:3] @ qd


@pytest.mark.parametrize("mode", ["flacco", "ding"])
def test_with_nothing_near_the_task_is_followed(panda_model, mode):
    arm = Arm(panda_model, mode)
    motion = arm.move([0.0, 0.1, 0.0])
    assert len(motion.restricted) == len(motion.qp.slack) == 0
    np.testing.assert_allclose(arm.hand(motion.command), [0.0, 0.1, 0.0], atol=2e-3)


def test_flacco_moves_the_hand_away_and_a_held_arm_brakes(panda_model):
    arm = Arm(panda_model, "flacco", [0.0, 0.2, 0.0])
    np.testing.assert_allclose(arm.hand(arm.move([0.0, 0.0, 0.0]).command), [0.0, -0.2, 0.0], atol=5e-3)
    np.testing.assert_allclose(arm.move([0.0, 0.3, 0.0], hold=True).qp.qd, np.zeros(7))


def test_ding_retreats_as_fast_as_its_limit_says_and_a_held_arm_brakes(panda_model):
    arm = Arm(panda_model, "ding", [0.0, 0.25, 0.0])
    motion, limit = arm.move([0.0, 0.3, 0.0]), DING.limit(arm.obstacles.body_distance)
    assert motion.restricted.tolist() == [0]
    np.testing.assert_allclose(motion.approach_limit, limit)
    assert arm.approach(motion.qp.qd) == pytest.approx(limit[0], abs=5e-3)
    np.testing.assert_allclose(arm.move([0.0, 0.3, 0.0], hold=True).qp.qd, np.zeros(7))


def test_an_arm_at_rest_begins_its_retreat_as_fast_as_its_joints_allow(panda_model):
    arm = Arm(panda_model, "ding", [0.0, 0.15, 0.0])
    qd = arm.step([0.0, 0.3, 0.0]).qp.qd
    assert arm.approach(qd) < -0.02
    assert (np.abs(qd) / (0.01 * arm.limits.qdd_max)).max() == pytest.approx(1.0)
