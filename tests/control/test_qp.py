"""Both solvers by numbers, against an exact one and DAQP, and where there is no answer."""

from dataclasses import replace
from itertools import product

import daqp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog
from tests.control.programs import answered
from tests.examples import examples
from tests.reference.problems import TOUCH, facing_rows, grazed, problem, stiff_row
from tests.reference.qp import Problem, kkt_residual
from tests.reference.qp import solve as solve_exactly

from pretouch.types import QpOutcome, QpSolution

N = 7
ONE = np.ones(N)
WEIGHT = 1000.0
SMALL = Problem(np.eye(N), -0.5 * ONE, -ONE, ONE, np.eye(N)[:2], np.full(2, 0.1), None)
"""|x - 0.5|^2 / 2 within +-1, and x_0, x_1 <= 0.1."""


def assert_none(answer: QpSolution, outcome: QpOutcome, status: str = "") -> None:
    """There is no answer, for this reason; weights of what contradicts are numbers all the same."""
    assert answer.outcome is outcome
    assert answer.status
    assert status in answer.status
    assert np.all(np.isfinite(answer.multipliers))


@pytest.mark.parametrize(
    ("row", "h", "width", "qd", "slack"),
    [
        # 1/2 (x - 0.5)^2 + 1000 / 2 (x - 0.1)^2 is least at x = (0.5 + 1000 * 0.1) / 1001 = 0.1003996
        (np.eye(N)[0], 0.1, 1.0, [100.5 / 1001] + [0.5] * 6, 100.5 / 1001 - 0.1),
        # a row that no joint can move is not dropped in silence
        (np.zeros(N), -0.04, 1.0, [0.5] * 7, 0.04),
        # a box without width is answered
        (ONE, 0.0, 0.0, [0.3] * 7, 2.1),
    ],
)
def test_a_soft_row_gives_way_by_numbers(row: np.ndarray, h: float, width: float, qd: list[float], slack: float):
    middle = 0.3 * (width == 0.0)
    lower, upper = np.full(N, middle - width), np.full(N, middle + width)
    answer = answered(replace(SMALL, lower=lower, upper=upper, G=row[None], h=np.array([h]), weight=WEIGHT))
    assert answer.outcome is QpOutcome.SOLVED
    np.testing.assert_allclose(answer.qd, qd, rtol=1e-9)
    np.testing.assert_allclose(answer.slack, [slack], rtol=1e-6)


# against the exact solver of the reference


def assert_exact(p: Problem) -> bool:
    """Hold the solver to the reference; return whether there is an answer."""
    real, exact = answered(p), solve_exactly(p)
    if exact.x is None:
        assert real.outcome is QpOutcome.INFEASIBLE
        # the sum of the rows by weights y >= 0 reads 0 x <= a negative number; linear programming says so too
        A, b, _ = p.rows()
        assert np.all(exact.multipliers >= 0)
        rest = np.abs(A.T @ exact.multipliers).max() * np.abs([p.lower, p.upper]).max()
        assert b @ exact.multipliers < -1e3 * rest
        program = linprog(np.zeros(len(p.f)), A_ub=p.G, b_ub=p.h, bounds=list(zip(p.lower, p.upper, strict=True)))
        assert program.status == 2
        return False
    assert real.outcome is QpOutcome.SOLVED
    assert kkt_residual(p, exact.x, exact.multipliers) <= 1e-12
    np.testing.assert_allclose(real.qd, exact.x, rtol=0, atol=1e-8)
    assert kkt_residual(p, real.qd, real.multipliers) <= 1e-8
    np.testing.assert_allclose(real.slack, np.maximum(p.G @ real.qd - p.h, 0.0), rtol=0, atol=1e-12)
    assert np.all((p.lower <= real.qd) & (real.qd <= p.upper))
    return True


ROWS = (1, 2, 4, 8, 20, 60, 128, 300)


def seeds(count: int) -> range:
    return range(100 * count, 100 * count + (4 if count > 100 else 12))


@pytest.mark.parametrize(
    ("count", "weight"), [*product((0, *ROWS), (None, WEIGHT)), *product((1, 4, 8, 20), (1.0, 1e6))]
)
def test_of_many_rows_the_few_that_count_decide(count: int, weight: float | None):
    for seed in seeds(count):
        assert assert_exact(replace(problem(seed, count, soft=weight is not None), weight=weight))


@pytest.mark.parametrize("count", ROWS)
def test_many_rows_hide_no_contradiction(count: int):
    for seed in seeds(count):
        assert not assert_exact(problem(seed, count, soft=False, feasible=False))


@pytest.mark.parametrize("gap", TOUCH)
def test_rows_met_by_a_hair(gap: float):
    for seed in range(5):
        assert assert_exact(grazed(problem(seed, 12, soft=True), seed, gap))
        # hard rows that are missed may leave no answer, or one by rounding alone
        assert assert_exact(grazed(problem(seed, 12, soft=False), seed, abs(gap)))


@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("gap", [2e-9, 9e-10, 5e-10, 1e-10])
def test_a_row_missed_by_less_than_a_nanometre_a_second_is_met(gap: float, soft: bool):
    # a solver that lets a row be missed by 1e-9 is off by up to 1.3e-8 rad/s here
    for seed in range(10):
        assert assert_exact(stiff_row(seed, soft, gap))


@pytest.mark.parametrize("angle", [1e-1, 1e-2, 1e-3])
def test_hard_rows_that_face_each_other(angle: float):
    # the edge of the wedge moves by rounding / angle: from 1e-5 on no solver in double precision is sure of 1e-8
    for seed in range(10):
        assert assert_exact(facing_rows(seed, angle))


# soft rows where rounding decides


def test_rows_that_were_violated_on_the_way_leave_no_rounding():
    # 300 heavy rows ask for the box's corner where the search begins, and none binds at the answer
    G = np.random.default_rng(1).uniform(0.1, 1.0, (300, 7))
    answer = answered(Problem(1e-3 * np.eye(7), 1e-3 * ONE, -ONE, ONE, G, -0.05 * G.sum(axis=1), 8e5))
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


def test_rows_that_meet_in_the_answer_do_not_hold_it_up():
    for seed in range(300):  # rows drawn through one point, so that ties abound
        rng = np.random.default_rng(seed)
        count = int(rng.integers(2, 9))
        at = rng.integers(-2, 3, N) * 0.25
        G, J = rng.integers(-1, 2, (count, N)) * 0.5, rng.integers(-1, 2, (3, N)).astype(float)
        H, f = J.T @ J + 1e-3 * np.eye(N), -J.T @ rng.integers(-1, 2, 3).astype(float)
        p = Problem(H, f, -0.5 * ONE, 0.5 * ONE, G, G @ at, WEIGHT)
        answer = answered(p)
        assert answer.outcome is QpOutcome.SOLVED, seed
        assert kkt_residual(p, answer.qd, answer.multipliers) <= 1e-8, seed


# hard rows, against DAQP

KINDS = ("random", "coarse", "equal", "opposite", "zeros", "narrow", "scaled", "through a point", "from rest")
ALWAYS_SOLVED = KINDS[-2:]


def hard(kind: str, seed: int) -> Problem:
    """Up to ten joints and forty rows; most kinds are feasible in some draws and infeasible in others."""
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(1, 11)), int(rng.integers(0, 41) if rng.random() < 0.3 else rng.integers(0, 9))
    J = rng.normal(size=(min(3, n), n))
    H, f = J.T @ J + 10.0 ** rng.uniform(-3, 0) * np.eye(n), -J.T @ rng.normal(size=len(J))
    lower, upper = -rng.uniform(0, 1, n), rng.uniform(0, 1, n)
    at = rng.uniform(lower, upper)
    G, h = rng.normal(size=(count, n)) * 10.0 ** rng.uniform(-2, 0, (count, 1)), rng.uniform(-0.1, 0.3, count)
    half = count // 2
    if kind == "coarse":
        G, h = rng.integers(-1, 2, (count, n)).astype(float), rng.integers(-1, 3, count) * 0.25
    if kind == "equal":
        G[half : 2 * half], h[half : 2 * half] = G[:half], h[:half]
    if kind == "opposite":
        gap = rng.choice([0.0, 0.01, -0.01]) * np.ones(half)
        h[:half] = G[:half] @ at
        G[half : 2 * half], h[half : 2 * half] = -G[:half], gap - h[:half]
    if kind == "zeros":
        G[::2], h[::2] = 0.0, np.abs(h[::2])
        h[:1] *= rng.choice([1.0, -1.0], p=[0.8, 0.2])
    if kind == "narrow":
        lower[::2] = upper[::2] = at[::2]
        h = np.maximum(h, G @ at) if rng.random() < 0.7 else h
    if kind == "through a point":
        h = G @ at
    if kind == "scaled":
        G[half : 2 * half], h[half : 2 * half] = 7.0 * G[:half], 7.0 * h[:half] - rng.choice([0.0, 1e-3, -1e-3])
    if kind == "from rest":
        h = np.maximum(h, 0.0)
    return Problem(H, f, lower, upper, G, h, None)


@pytest.mark.parametrize("kind", KINDS)
@examples(200)
@given(seed=st.integers(0, 2**32 - 1))
def test_hard_rows_are_answered_as_daqp_does(kind: str, seed: int):
    p = hard(kind, seed)
    n, count = len(p.f), len(p.h)
    answer = answered(p)
    above, below = np.r_[p.upper, p.h], np.r_[p.lower, np.full(count, -1e30)]
    x, _, flag, _ = daqp.solve(p.H, p.f, p.G, above, below, np.zeros(n + count, np.int32), primal_tol=1e-12)
    box, rows = answer.multipliers[:n], answer.multipliers[n:]
    largest = np.abs(answer.multipliers).max()
    assert np.all(rows >= 0)
    if answer.outcome is QpOutcome.INFEASIBLE:
        assert flag != 1
        # Farkas: bounds and rows, added up with weights >= 0, read 0 <= something negative
        np.testing.assert_allclose(p.G.T @ rows + box, 0.0, rtol=0, atol=1e-9 * largest)
        assert p.h @ rows + p.upper @ np.maximum(box, 0) - p.lower @ np.maximum(-box, 0) < 0
        return
    assert answer.outcome is QpOutcome.SOLVED
    assert np.all((p.lower <= answer.qd) & (answer.qd <= p.upper))
    assert (p.G @ answer.qd - p.h).max(initial=0.0) <= 1e-9
    # what DAQP calls solved is compared, what it calls else must be optimal
    pull = p.H @ answer.qd + p.f + box + p.G.T @ rows
    np.testing.assert_allclose(pull, 0.0, rtol=0, atol=1e-9 * (1.0 + largest))
    if flag == 1:
        ours, theirs = (0.5 * x @ p.H @ x + p.f @ x for x in (answer.qd, x))
        assert ours == pytest.approx(theirs, rel=0, abs=1e-9)


def test_every_kind_has_problems_with_and_without_an_answer():
    both = {QpOutcome.SOLVED, QpOutcome.INFEASIBLE}
    for kind in KINDS:
        outcomes = {answered(hard(kind, seed)).outcome for seed in range(60)}
        assert outcomes == ({QpOutcome.SOLVED} if kind in ALWAYS_SOLVED else both), kind


def test_rows_that_miss_each_other_by_rounding_alone_do_not_contradict():
    G = np.array([[1.0, 1.0], [-1.0, -1.0], [3.0, 3.0]])
    for gap in (0.0, 1e-16, 1e-13, 1e-11):
        h = np.array([0.1, -0.1 - gap, 0.3 - gap])
        answer = answered(Problem(np.eye(2), np.ones(2), -np.ones(2), np.ones(2), G, h, None))
        assert answer.outcome is QpOutcome.SOLVED
        np.testing.assert_allclose(answer.qd, 0.05, atol=1e-10)


# no answer


@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", ["H", "f", "lower", "upper", "G", "h"])
def test_nothing_that_is_not_finite_gets_through(part: str, value: float, soft: bool):
    for at in (0, 1, -1):
        wrong = getattr(SMALL, part).copy()
        wrong.flat[at] = value
        answer = answered(replace(SMALL, weight=WEIGHT if soft else None, **{part: wrong}))
        assert_none(answer, QpOutcome.FAILED, "not finite")


@pytest.mark.parametrize(
    ("bad", "outcome"),
    [
        ({"H": -np.eye(N)}, QpOutcome.FAILED),
        ({"h": np.array([-1.5, 0.1])}, QpOutcome.INFEASIBLE),
        ({"G": np.zeros((1, N)), "h": np.array([-0.04])}, QpOutcome.INFEASIBLE),
        ({"G": np.vstack([np.eye(N)[0], -np.eye(N)[0]]), "h": np.full(2, -0.1)}, QpOutcome.INFEASIBLE),
    ],
)
def test_a_problem_without_an_answer_has_none(bad: dict[str, np.ndarray], outcome: QpOutcome):
    assert_none(answered(replace(SMALL, **bad)), outcome)


def test_a_contradiction_names_its_rows():
    G, h = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]]), np.array([-0.2, 0.3, 0.1, 0.0])
    p = Problem(np.eye(2), np.zeros(2), -np.ones(2), np.ones(2), G, h, None)
    answer = answered(p)
    assert answer.outcome is QpOutcome.INFEASIBLE
    np.testing.assert_allclose(answer.multipliers, [0, 0, 1, 0, 1, 0])
    # x_0 <= -1.5 contradicts the lower bound of x_0
    answer = answered(replace(p, G=G[:1], h=np.array([-1.5])))
    np.testing.assert_allclose(answer.multipliers, [-1, 0, 1])


@pytest.mark.parametrize("soft", [True, False])
def test_a_solve_beyond_its_budget_has_no_answer(soft: bool):
    needed = []
    for seed in range(20):
        p = problem(seed, 20, soft)
        whole = answered(p)
        for budget in range(1, 60):
            answer = answered(p, budget)
            if answer.outcome is QpOutcome.SOLVED:
                np.testing.assert_array_equal(answer.qd, whole.qd)
                break
            assert_none(answer, QpOutcome.FAILED, "iteration")
        needed.append(budget)
    # some problems need more than one iteration, and none more than a few
    assert 1 < max(needed) < 50
