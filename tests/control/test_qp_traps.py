"""What the solver answers wrongly, shown on the solver itself (daqp 0.11) and shown not to get through `solve`."""

from dataclasses import dataclass, replace
from itertools import product

import daqp
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
HARD, SOFT = 0, 8
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


def raw(p: Problem, **settings: float) -> tuple[int, np.ndarray]:
    """The solver's own answer: exit flag and x. `weight` is what soft rows weigh by `soft_weights`."""
    weight = settings.pop("weight", None)
    model = set_up(p)
    model.settings = settings
    if weight is not None:
        model.soft_weights(*[np.full(N + len(p.h), 1.0 / weight)] * 2)
    x, _, flag, _ = model.solve()
    return flag, x


def set_up(p: Problem) -> daqp.Model:
    model = daqp.Model()
    sense = np.r_[np.zeros(N), np.full(len(p.h), SOFT if p.soft else HARD)].astype(np.int32)
    flag, _ = model.setup(p.H, p.f, p.G, np.r_[p.upper, p.h], np.r_[p.lower, np.full(len(p.h), -1e30)], sense)
    assert flag > 0
    return model


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


# NaN


def test_the_solver_calls_nan_in_the_cost_a_success():
    for part in ("H", "f"):
        flag, x = raw(problem().spoiled(part, np.nan))
        assert flag == 1
        assert np.isnan(x).any()


@pytest.mark.parametrize(("part", "at"), [("G", 0), ("h", 0)])
def test_the_solver_drops_a_row_with_nan_in_silence(part: str, at: int):
    flag, x = raw(problem().spoiled(part, np.nan, at))
    assert flag == 1
    # the row asked for x_0 <= 0.1
    np.testing.assert_allclose(x, [0.5, 0.1, 0.5, 0.5, 0.5, 0.5, 0.5])


def test_the_solver_drops_a_limit_that_is_nan_in_silence():
    tight = replace(problem(), upper=np.full(N, 0.3))
    flag, x = raw(tight.spoiled("upper", np.nan, at=4))
    assert flag == 1
    assert x[4] == pytest.approx(0.5)


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


def test_the_solver_cannot_set_up_a_hard_row_of_zeros_that_does_not_hold():
    p = replace(problem(), G=np.zeros((1, N)), h=np.array([-0.04]))
    model = daqp.Model()
    flag, _ = model.setup(p.H, p.f, p.G, np.r_[p.upper, p.h], np.r_[p.lower, -1e30], np.zeros(N + 1, np.int32))
    assert flag == -1
    with pytest.raises(RuntimeError):
        model.solve()
    assert_braking(ours(p), p, QpOutcome.INFEASIBLE)


def test_no_rows_are_no_trouble():
    for soft in (True, False):
        p = replace(problem(soft), G=np.zeros((0, N)), h=np.zeros(0))
        np.testing.assert_allclose(ours(p).qd, 0.5, rtol=1e-12)


def test_the_solver_leaves_garbage_where_hard_rows_contradict_the_box():
    p = replace(problem(), h=np.array([-1.5, 0.1]))
    flag, x = raw(p)
    assert flag == -1
    assert np.any(x < p.lower)
    assert_braking(ours(p), p, QpOutcome.INFEASIBLE)


def test_a_soft_row_that_is_violated_is_an_answer():
    p = problem(soft=True)
    assert raw(p, weight=WEIGHT)[0] == 2
    assert ours(p).outcome is QpOutcome.SOLVED


# weights


def test_the_solver_scales_the_common_weight_of_soft_rows():
    off = []
    for seed in range(20):
        p = random_problem(seed, 4)
        off.append(np.abs(raw(p, primal_tol=1e-9, rho_soft=1.0 / WEIGHT)[1] - exact(p, WEIGHT)).max())
    assert max(off) > 0.05


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


def test_the_solver_takes_a_row_that_is_nearly_met_for_met():
    # in displacements of 0.1 ms the solver's own tolerance is 1 mm/s of a row's limit
    H, period = np.eye(N), 1e-4
    p = replace(problem(), H=H, f=-H @ np.full(N, 0.101))
    moved = replace(p, f=p.f * period, lower=p.lower * period, upper=p.upper * period, h=p.h * period)
    flag, displaced = raw(moved)
    assert flag == 1
    np.testing.assert_allclose(displaced[:2] / period, 0.101)
    np.testing.assert_allclose(ours(p).qd[:2], 0.1, atol=1e-8)


def test_hard_rows_hold_to_a_hundred_millionth():
    for seed in range(40):
        p = random_problem(seed, 6)
        hard = replace(p, h=np.abs(p.h), soft=False)
        answer = ours(hard)
        assert answer.outcome is QpOutcome.SOLVED
        assert (hard.G @ answer.qd <= hard.h + 1e-8).all()
        assert ((hard.lower <= answer.qd) & (answer.qd <= hard.upper)).all()


# stale data


@pytest.mark.parametrize(
    ("change", "flag"),
    [({"H": -np.eye(N)}, -5), ({"bupper": np.full(N + 2, -5.0)}, -1), ({"f": np.full(N, np.nan)}, 0)],
)
def test_the_solver_calls_it_success_after_an_update_that_failed(change: dict[str, np.ndarray], flag: int):
    model = set_up(problem())
    model.solve()
    assert model.update(**change) == flag
    x, _, after, _ = model.solve()
    assert after == 1
    # none is the answer to the changed problem: either what was before, or NaN
    assert np.isnan(x).any() or np.all(x >= -1.0)


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


def test_the_solver_answers_something_where_its_iterations_end():
    flag, x = raw(problem(), iter_limit=1)
    assert flag == -4
    assert np.all(np.isfinite(x))


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
