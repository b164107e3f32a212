"""What solvers answer wrongly does not get through `solve`: numbers that are none, weights, tolerance, budget."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pretouch.control.approach_restriction import ApproachRestriction
from pretouch.control.joint_box import brake, joint_box
from pretouch.control.path import Circle
from pretouch.control.qp import Cost, solve
from pretouch.control.restriction import ApproachRows
from pretouch.controller import Controller
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Inputs, Mode, QpOutcome, QpSolution, RangeReadings, RangeStatus, RobotState

N = 7
STOP = np.full(N, 0.0123)
WEIGHT = 1000.0
PARTS = ["H", "f", "lower", "upper", "G", "h"]


@dataclass(frozen=True)
class Problem:
    """Minimise 1/2 x^T H x + f^T x over lower <= x <= upper and G x <= h, softly or not."""

    H: np.ndarray
    f: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    G: np.ndarray
    h: np.ndarray
    soft: bool = False

    def spoiled(self, part: str, value: float, at: int = 0) -> "Problem":
        wrong = getattr(self, part).copy()
        wrong.flat[at] = value
        return replace(self, **{part: wrong})


def problem(soft: bool = False) -> Problem:
    """|x - 0.5|^2 / 2 within +-1, and x_0, x_1 <= 0.1."""
    return Problem(np.eye(N), np.full(N, -0.5), np.full(N, -1.0), np.full(N, 1.0), np.eye(N)[:2], np.full(2, 0.1), soft)


def random_problem(seed: int, rows: int) -> Problem:
    """A redundant task and soft rows of lengths between 0.01 and 1, some of them violated by what the task asks."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(3, N))
    G = rng.normal(size=(rows, N)) * 10.0 ** rng.uniform(-2, 0, (rows, 1))
    H, f = J.T @ J + 1e-3 * np.eye(N), -J.T @ rng.normal(size=3)
    return Problem(H, f, np.full(N, -0.5), np.full(N, 0.5), G, rng.uniform(-0.2, 0.1, rows), soft=True)


def ours(p: Problem, weight: float = WEIGHT, budget: int = 500) -> QpSolution:
    """The adapter's answer."""
    return solve(Cost(p.H, p.f), p.lower, p.upper, ApproachRows(p.G, p.h, p.soft), weight, STOP, budget)


def exact(p: Problem, weight: float) -> np.ndarray:
    """The optimum with soft rows: for each set of violated rows a bounded least-squares problem, until one agrees."""
    root = np.linalg.cholesky(p.H).T
    for violated in product([False, True], repeat=len(p.h)):
        v = np.array(violated, dtype=bool)
        A = np.vstack([root, np.sqrt(weight) * p.G[v]])
        b = np.concatenate([-np.linalg.solve(root.T, p.f), np.sqrt(weight) * p.h[v]])
        x = lsq_linear(A, b, (p.lower, p.upper), method="bvls", tol=1e-15).x
        if np.array_equal(p.G @ x > p.h, v):
            return np.asarray(x)
    raise AssertionError("no set of violated rows agrees with its own optimum")


def assert_braking(answer: QpSolution, p: Problem, outcome: QpOutcome) -> None:
    assert answer.outcome is outcome
    assert answer.status
    np.testing.assert_array_equal(answer.qd, STOP)
    assert len(answer.slack) == len(p.h)
    assert answer.multipliers.shape == (N + len(p.h),)
    assert np.all(np.isfinite(answer.multipliers))


@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", PARTS)
def test_nothing_that_is_not_finite_gets_through(part: str, value: float, soft: bool):
    for at in (0, 1, -1):
        p = problem(soft).spoiled(part, value, at)
        answer = ours(p)
        assert_braking(answer, p, QpOutcome.FAILED)
        assert "not finite" in answer.status


# rows


def test_no_rows_are_no_trouble():
    for soft in (True, False):
        p = replace(problem(soft), G=np.zeros((0, N)), h=np.zeros(0))
        np.testing.assert_allclose(ours(p).qd, 0.5, rtol=1e-12)
        assert ours(p).slack.shape == (0,)


# weights


@pytest.mark.parametrize("weight", [1.0, 1e3, 1e6])
@pytest.mark.parametrize("rows", [1, 4, 6])
def test_soft_rows_weigh_what_was_asked(rows: int, weight: float):
    violated = 0
    for seed in range(20):
        p = random_problem(seed, rows)
        answer, x = ours(p, weight), exact(p, weight)
        assert answer.outcome is QpOutcome.SOLVED
        np.testing.assert_allclose(answer.qd, x, atol=1e-7)
        np.testing.assert_allclose(answer.slack, np.maximum(p.G @ x - p.h, 0.0), atol=1e-7)
        violated += np.any(answer.slack > 1e-6)
    assert violated > 5


# tolerance


def test_hard_rows_hold_to_a_hundred_millionth():
    for seed in range(40):
        p = random_problem(seed, 6)
        hard = replace(p, h=np.abs(p.h), soft=False)
        answer = ours(hard)
        assert answer.outcome is QpOutcome.SOLVED
        assert (hard.G @ answer.qd <= hard.h + 1e-8).all()
        assert ((hard.lower <= answer.qd) & (answer.qd <= hard.upper)).all()


# stale data


def bad_problems() -> list[tuple[Problem, QpOutcome]]:
    good = problem()
    return [
        *[(good.spoiled(part, np.nan), QpOutcome.FAILED) for part in PARTS],
        (replace(good, H=-np.eye(N)), QpOutcome.FAILED),
        (replace(good, h=np.array([-1.5, 0.1])), QpOutcome.INFEASIBLE),
        (replace(good, G=np.zeros((1, N)), h=np.array([-0.04])), QpOutcome.INFEASIBLE),
        (replace(good, G=np.vstack([np.eye(N)[0], -np.eye(N)[0]]), h=np.full(2, -0.1)), QpOutcome.INFEASIBLE),
    ]  # fmt: skip


@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("rows", [0, 1, 4])
def test_a_bad_problem_leaves_nothing_behind(rows: int, soft: bool):
    good = random_problem(3, rows)
    good = replace(good, h=good.h if soft else np.abs(good.h), soft=soft)
    before = ours(good)
    assert before.outcome is QpOutcome.SOLVED
    for bad, outcome in bad_problems():
        assert_braking(ours(bad), bad, outcome)
        after = ours(good)
        assert after.outcome is before.outcome
        np.testing.assert_array_equal(after.qd, before.qd)
        np.testing.assert_array_equal(after.slack, before.slack)
        np.testing.assert_array_equal(after.multipliers, before.multipliers)


def test_answers_do_not_depend_on_the_problem_before():
    problems = [random_problem(seed, rows) for seed in range(10) for rows in (0, 1, 4, 6)]
    forwards = [ours(p).qd for p in problems]
    backwards = [ours(p).qd for p in reversed(problems)][::-1]
    np.testing.assert_array_equal(forwards, backwards)


# budget


@pytest.mark.parametrize("soft", [True, False])
def test_a_solve_beyond_its_budget_is_the_braking_command(soft: bool):
    needed = [1, 1]
    for seed in range(20):
        p = replace(random_problem(seed, 6), soft=soft)
        p = p if soft else replace(p, h=np.abs(p.h))
        whole = ours(p)
        assert whole.outcome is QpOutcome.SOLVED
        for budget in range(1, 60):
            answer = ours(p, budget=budget)
            if answer.outcome is QpOutcome.SOLVED:
                np.testing.assert_array_equal(answer.qd, whole.qd)
                break
            assert_braking(answer, p, QpOutcome.FAILED)
            assert "iteration" in answer.status
        needed.append(budget)
    # some problems need more than one iteration, and none more than a few
    assert 1 < max(needed) < 50


@pytest.mark.parametrize("mode", ["slack", "hard"])
def test_beyond_its_budget_the_controller_brakes_holds_and_says_so(
    panda_model: RobotModel, paper_skin: Skin, mode: str
):
    paper = PROFILES["paper"]
    profile = replace(
        paper, window=replace(paper.window, samples=5), approach=ApproachRestriction(rows=mode),
        task=replace(paper.task, acceleration_m_s2=100.0),
    )  # fmt: skip
    hurried = replace(profile, failure=replace(profile.failure, solver_iterations=1))
    ample, brief = (Controller(panda_model, paper_skin, no_fixtures(), Circle(), p) for p in (profile, hurried))
    q, qd, time = panda_model.description.q_ready.copy(), np.zeros(N), 0.0

    def inputs() -> Inputs:
        readings = RangeReadings(np.full(7, time), np.full(7, 0.5), np.full(7, int(RangeStatus.OK)))
        return Inputs(time, RobotState(time, q, qd, q, qd, np.zeros(N), np.zeros(6)), readings)

    state, failed = ample.init(inputs().robot), 0
    for _ in range(100):
        step, after = ample.step(state, inputs())
        short, held = brief.step(state, inputs())
        if short.qp.outcome is QpOutcome.FAILED:
            failed += 1
            assert short.mode is Mode.HOLD
            assert held.mode.latched
            assert "iteration" in short.reason
            lower, upper = joint_box(q, qd, brief.limits)
            np.testing.assert_array_equal(short.command, brake(qd, lower, upper, brief.limits))
        else:
            np.testing.assert_array_equal(short.command, step.command)
        state, qd, q, time = after, step.command, q + step.command * 0.01, time + 0.01
    assert failed > 5
