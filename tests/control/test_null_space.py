"""What moves in the null space leaves the task as it is, and takes the arm away from what is near."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.control.programs import task_cost

from pretouch.control.task import away, projector
from pretouch.params import NullSpaceMotion, TaskParams
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles, no_obstacles

PAPER, TASK = TaskParams(), TaskParams(mid_joint_projected=True)
MOTION = NullSpaceMotion(distance_m=0.25, speed_m_s=0.1, joint_rad_s=0.5, rate_rad_s2=10.0).numbers
NO_MOTION = np.zeros(7)


def postures(model: RobotModel, count: int) -> np.ndarray:
    return np.random.default_rng(1000).uniform(model.q_min, model.q_max, (count, 7))


def cost(J, x_d, q, q_mid, null=NO_MOTION, params=TASK):
    return task_cost(J, x_d, q, q_mid, params, null)


@pytest.mark.parametrize("m", [3, 6])
def test_the_projector_is_that_of_the_singular_value_decomposition(panda_model: RobotModel, m: int):
    for q in postures(panda_model, 20):
        J = panda_model.ee_jacobian(panda_model.kinematics(q))[:m]
        _, s, Vt = np.linalg.svd(J)
        if s[-1] > 0.05:
            # the damping of 1e-6 m^2 leaves c / (s^2 + c) of a direction
            np.testing.assert_allclose(projector(J), Vt[m:].T @ Vt[m:], atol=1e-6 / s[-1] ** 2)


@given(st.integers(0, 6), st.integers(0, 2**32 - 1))
def test_the_projector_is_finite_at_any_rank(rank, seed):
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(6, rank)) @ rng.normal(size=(rank, 7))
    N = projector(J)
    assert np.isfinite(N).all()
    np.testing.assert_allclose(N, N.T, atol=1e-9)
    eigenvalues = np.linalg.eigvalsh(N)
    assert eigenvalues.min() > -1e-6
    assert eigenvalues.max() < 1 + 1e-6


@pytest.mark.parametrize("m", [3, 6])
def test_a_motion_in_the_null_space_leaves_the_end_effectors_velocity_unchanged(panda_model: RobotModel, m: int):
    rng = np.random.default_rng(1001)
    for q in postures(panda_model, 20):
        J = panda_model.ee_jacobian(panda_model.kinematics(q))[:m]
        if np.linalg.svd(J, compute_uv=False)[-1] < 0.05:
            continue
        x_d, null = 0.1 * rng.normal(size=m), 0.5 * rng.normal(size=7)
        H, f = cost(J, x_d, q, panda_model.q_mid, null)
        qd = -np.linalg.solve(H, f)
        np.testing.assert_allclose(J @ qd, x_d, atol=2e-5)
        # and in the null space it is what was asked for
        N = np.eye(7) - np.linalg.pinv(J) @ J
        np.testing.assert_allclose(N @ qd, N @ (null + (panda_model.q_mid - q) / 5.0), atol=1e-3)


def test_the_papers_term_drags_what_the_projected_one_does_not(panda_model: RobotModel):
    q = panda_model.description.q_ready
    J, x_d = panda_model.ee_jacobian(panda_model.kinematics(q)), np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
    paper_H, paper_f = task_cost(J, x_d, q, panda_model.q_mid, PAPER)
    H, f = cost(J, x_d, q, panda_model.q_mid)
    dragged = np.linalg.norm(J @ np.linalg.solve(paper_H, -paper_f) - x_d)
    assert dragged > 1e-3
    assert np.linalg.norm(J @ np.linalg.solve(H, -f) - x_d) < 0.01 * dragged


def test_the_hessian_is_positive_definite_where_the_arm_is_singular(panda_model: RobotModel):
    stretched = np.zeros(7)
    J = panda_model.ee_jacobian(panda_model.kinematics(stretched))
    for jacobian in (J, J[:3], np.zeros((6, 7))):
        H, _ = cost(jacobian, np.zeros(len(jacobian)), stretched, panda_model.q_mid)
        assert np.linalg.eigvalsh(H).min() > 0


def test_without_the_switch_the_mid_joint_term_is_the_papers(panda_model: RobotModel):
    q = panda_model.description.q_ready + 0.1
    J, x_d = panda_model.ee_jacobian(panda_model.kinematics(q)), np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0])
    paper_H, paper_f = task_cost(J, x_d, q, panda_model.q_mid, PAPER)
    H, f = cost(J, x_d, q, panda_model.q_mid, params=PAPER)
    np.testing.assert_allclose(H, paper_H + 0.001 * projector(J), atol=1e-12)
    np.testing.assert_allclose(f, paper_f, atol=1e-12)


def at(distance: float) -> Obstacles:
    """One obstacle near link 1."""
    return no_obstacles(1)._replace(link=np.ones(1, np.int64), body_distance=np.array([distance]))


def asked(distance: float, row: np.ndarray, hand: bool = False, last: np.ndarray | None = None) -> np.ndarray:
    moved_by = np.array([[False, False], [True, hand]])
    return away(
        np.zeros(2) if last is None else last, row[None], np.zeros(1, np.int64), at(distance), moved_by,
        MOTION, 1.0,
    )  # fmt: skip


def test_a_near_point_is_asked_to_go_away_by_numbers():
    row = np.array([0.5, 0.0])
    # half of 0.25 m: 0.1 * (1 - 0.5)^2 = 0.025 m/s, with 0.5 m of lever
    np.testing.assert_allclose(asked(0.125, row), [-0.05, 0.0])
    np.testing.assert_allclose(row @ asked(0.0, row), -0.1)
    np.testing.assert_array_equal(asked(0.25, row), [0.0, 0.0])
    np.testing.assert_array_equal(asked(0.0, row, hand=True), [0.0, 0.0])


@given(st.floats(-0.1, 0.3), st.floats(-1, 1), st.floats(-1, 1))
def test_what_is_asked_is_finite_and_bounded_whatever_the_row(distance, a, b):
    z = asked(distance, np.array([a, b]))
    assert np.isfinite(z).all()
    assert np.linalg.norm(z) <= 0.5 + 1e-12


def test_it_changes_at_no_more_than_its_rate():
    moved_by = np.array([[False], [False]])
    z = away(
        np.array([0.2]), np.ones((1, 1)), np.zeros(1, np.int64), at(0.0), moved_by,
        MOTION, 0.001,
    )  # fmt: skip
    np.testing.assert_allclose(z, [0.19])
