"""Eq. 2 by numbers, and the solver's answers against the conditions of optimality."""

from dataclasses import replace

import numpy as np
import pytest
from tests.control.programs import answered, task_cost
from tests.reference.qp import Problem, kkt_residual
from tests.reference.qp import solve as solve_exactly

from pretouch.control.approach import approach_rows, row_numbers
from pretouch.control.joint_box import JointLimits, joint_box
from pretouch.control.task import damping, manipulability
from pretouch.params import RestrictionParams, TaskParams
from pretouch.perception.closest import closest_points
from pretouch.robot.model import RobotModel
from pretouch.types import QpOutcome

TASK = TaskParams()
WEIGHT = RestrictionParams().slack_weight


def panda_problem(model: RobotModel, seed: int, soft: bool, count: int | None = None, still: bool = False) -> Problem:
    """A random posture, velocity and task, with the rows of random points near the body."""
    rng = np.random.default_rng(seed)
    arm, q = model.description, rng.uniform(model.q_min, model.q_max)
    qd = np.zeros(7) if still else arm.qd_max * rng.uniform(-0.7, 0.7, 7)
    kin = model.kinematics(q)
    jacobian = model.ee_jacobian(kin)[: 3 if seed % 2 else 6]
    lower, upper = joint_box(q, qd, JointLimits(model.q_min, model.q_max, arm.qd_max, arm.qdd_max, 0.01).table)[:2]
    k = int(rng.integers(0, 12)) if count is None else count
    points = kin.position[rng.integers(2, model.ee + 1, k)] + rng.uniform(-0.6, 0.6, (k, 3))
    obstacles = closest_points(kin, model.body, kin.position[model.ee], np.arange(k), points, np.ones((k, 3)))
    restriction = RestrictionParams(rows="slack" if soft else "hard")
    rows = approach_rows(kin, model.moved_by, obstacles, row_numbers(restriction))
    # moving fast, most scenes leave hard rows no way out: give them more room
    h = rows.h if soft else rows.h + rng.uniform(0, 0.5)
    velocity = rng.uniform(-0.5, 0.5, len(jacobian))
    H, f = task_cost(jacobian, velocity, q, model.q_mid, TASK)
    return Problem(H, f, lower, upper, rows.G, h, WEIGHT if soft else None)


# eq. 2


def test_damping_by_numbers():
    # 0.1 * (1 - 0.0005 / 0.001)^2 = 0.1 * 0.25;   none from the threshold on;   all of it at a singularity
    assert damping(0.0005, 0.1, 0.001) == pytest.approx(0.025)
    assert damping(0.001, 0.1, 0.001) == 0.0
    assert damping(0.0, 0.1, 0.001) == 0.1


def test_manipulability_by_numbers():
    # J J^T = diag(4, 9), det 36, root 6
    assert manipulability(np.array([[2.0, 0, 0], [0, 3.0, 0]])) == pytest.approx(6.0)
    assert manipulability(np.array([[1.0, 2, 3], [2, 4, 6]])) == pytest.approx(0.0, abs=1e-6)


def test_cost_by_numbers():
    # J = (1, 2), x_d = 3; w = sqrt(5) is far from singular, so mu = 0; k = 0.1; qd_mid = (0.4 - 0.4, 1.4 - 0.4) / 5
    params = TaskParams(mid_joint_gain=0.1)
    H, f = task_cost(np.array([[1.0, 2.0]]), np.array([3.0]), np.full(2, 0.4), np.array([0.4, 1.4]), params)
    np.testing.assert_allclose(H, [[1.1, 2.0], [2.0, 4.1]])
    np.testing.assert_allclose(f, [-3.0, -6.0 - 0.1 * 0.2])


@pytest.mark.parametrize("scale", [1.0, 1e-2])
@pytest.mark.parametrize("seed", range(10))
def test_gradient_is_that_of_eq_2_written_out(seed: int, scale: float):
    rng = np.random.default_rng(seed)
    J, x_d = scale * rng.normal(size=(3, 7)), rng.normal(size=3)  # the smaller scale is damped
    q, q_mid, at = rng.normal(size=7), rng.normal(size=7), rng.normal(size=7)
    w = np.sqrt(np.linalg.det(J @ J.T))
    mu = 0.1 * (1 - w / 0.001) ** 2 if w < 0.001 else 0.0
    assert (mu > 0) == (scale < 1)

    def g(qd: np.ndarray) -> float:
        error, to_middle = x_d - J @ qd, (q_mid - q) / 5.0 - qd
        return 0.5 * error @ error + mu / 2 * qd @ qd + 0.001 / 2 * to_middle @ to_middle

    H, f = task_cost(J, x_d, q, q_mid, TASK)
    differences = [(g(at + 1e-4 * e) - g(at - 1e-4 * e)) / 2e-4 for e in np.eye(7)]
    np.testing.assert_allclose(H @ at + f, differences, rtol=1e-8, atol=1e-8)


# answers


@pytest.mark.parametrize("block", range(8))
@pytest.mark.parametrize("soft", [True, False])
def test_answers_are_optimal(panda_model: RobotModel, soft: bool, block: int):
    solved = 0
    for seed in range(50 * block, 50 * block + 50):
        problem = panda_problem(panda_model, seed, soft)
        answer = answered(problem)
        if answer.outcome is QpOutcome.SOLVED:
            solved += 1
            assert kkt_residual(problem, answer.qd, answer.multipliers) <= 1e-8
            excess = problem.G @ answer.qd - problem.h
            np.testing.assert_allclose(answer.slack, np.maximum(excess, 0), atol=1e-12)
            assert np.all((problem.lower <= answer.qd) & (answer.qd <= problem.upper))
        else:
            assert answer.outcome is QpOutcome.INFEASIBLE
            assert not soft
            assert solve_exactly(problem).x is None
    assert solved >= (50 if soft else 15)


@pytest.mark.parametrize("seed", range(40))
def test_from_rest_hard_rows_ahead_of_d_repulse_are_always_solved(panda_model: RobotModel, seed: int):
    problem = panda_problem(panda_model, seed, soft=False, count=10, still=True)
    ahead = replace(problem, h=np.maximum(problem.h, 0.0))
    answer = answered(ahead)
    assert answer.outcome is QpOutcome.SOLVED
    assert kkt_residual(ahead, answer.qd, answer.multipliers) <= 1e-8


def test_rows_that_were_violated_on_the_way_leave_no_rounding():
    # 300 heavy rows ask for the box's corner where the search begins, and none binds at the answer
    G, one = np.random.default_rng(1).uniform(0.1, 1.0, (300, 7)), np.ones(7)
    answer = answered(Problem(1e-3 * np.eye(7), 1e-3 * one, -one, one, G, -0.05 * G.sum(axis=1), 8e5))
    np.testing.assert_allclose(answer.qd, -1.0, atol=1e-12)
    assert not answer.slack.any()


@pytest.mark.parametrize("seed", [210, 223, 2534, 2547, 3900, 5214, 8212, 9219, 10970, 13595, 14760, 14930, 17572])
def test_an_answer_of_zero_on_bounds_and_rows_is_found(seed: int):
    # as at rest with objects near: what rounding leaves of the gradient shrinks with x, down to the least of numbers
    rng = np.random.default_rng(seed)
    count = 4 if seed == 9219 else 2
    lower, upper = -rng.uniform(0, 0.3, 7) * (rng.random(7) < 0.6), rng.uniform(0.01, 0.3, 7) * (rng.random(7) < 0.7)
    G = rng.uniform(-0.1, 0.5, (count, 7))
    answer = answered(Problem(np.eye(7), np.zeros(7), lower, upper + 1e-3, G, np.zeros(count), 1e6))
    assert answer.outcome is QpOutcome.SOLVED
    np.testing.assert_allclose(answer.qd, 0.0, atol=1e-12)


@pytest.mark.parametrize("seed", range(300))
def test_rows_that_meet_in_the_answer_do_not_hold_it_up(seed: int):
    # rows drawn through one point, so that ties abound
    rng = np.random.default_rng(seed)
    n, count = 7, int(rng.integers(2, 9))
    at = rng.integers(-2, 3, n) * 0.25
    G = rng.integers(-1, 2, (count, n)) * 0.5
    J = rng.integers(-1, 2, (3, n)).astype(float)
    H, f = J.T @ J + 1e-3 * np.eye(n), -J.T @ rng.integers(-1, 2, 3).astype(float)
    problem = Problem(H, f, np.full(n, -0.5), np.full(n, 0.5), G, G @ at, WEIGHT)
    answer = answered(problem)
    assert answer.outcome is QpOutcome.SOLVED
    assert kkt_residual(problem, answer.qd, answer.multipliers) <= 1e-8
