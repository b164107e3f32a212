"""What solvers answer wrongly does not get through: numbers that are none, weights, budget."""

from dataclasses import replace

import numpy as np
import pytest
from tests.control.programs import answered, assert_none
from tests.reference.qp import Problem
from tests.reference.qp import solve as solve_exactly

from pretouch.types import QpOutcome

N = 7
WEIGHT = 1000.0
PARTS = ["H", "f", "lower", "upper", "G", "h"]


def spoiled(p: Problem, part: str, value: float, at: int = 0) -> Problem:
    wrong = getattr(p, part).copy()
    wrong.flat[at] = value
    return replace(p, **{part: wrong})


def problem(soft: bool = False) -> Problem:
    """|x - 0.5|^2 / 2 within +-1, and x_0, x_1 <= 0.1."""
    one = np.ones(N)
    return Problem(np.eye(N), -0.5 * one, -one, one, np.eye(N)[:2], np.full(2, 0.1), WEIGHT if soft else None)


def random_problem(seed: int, rows: int, soft: bool = True, weight: float = WEIGHT) -> Problem:
    """A redundant task and rows of lengths between 0.01 and 1, if soft some of them violated by what the task asks."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(3, N))
    G = rng.normal(size=(rows, N)) * 10.0 ** rng.uniform(-2, 0, (rows, 1))
    H, f = J.T @ J + 1e-3 * np.eye(N), -J.T @ rng.normal(size=3)
    h = rng.uniform(-0.2, 0.1, rows)
    return Problem(H, f, np.full(N, -0.5), np.full(N, 0.5), G, h if soft else np.abs(h), weight if soft else None)


@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("part", PARTS)
def test_nothing_that_is_not_finite_gets_through(part: str, value: float, soft: bool):
    for at in (0, 1, -1):
        p = spoiled(problem(soft), part, value, at)
        answer = answered(p)
        assert_none(answer, QpOutcome.FAILED)
        assert "not finite" in answer.status


# weights


@pytest.mark.parametrize("weight", [1.0, 1e3, 1e6])
@pytest.mark.parametrize("rows", [1, 4, 6])
def test_soft_rows_weigh_what_was_asked(rows: int, weight: float):
    violated = 0
    for seed in range(20):
        p = random_problem(seed, rows, weight=weight)
        answer, x = answered(p), solve_exactly(p).x
        assert answer.outcome is QpOutcome.SOLVED
        np.testing.assert_allclose(answer.qd, x, atol=1e-7)
        np.testing.assert_allclose(answer.slack, np.maximum(p.G @ x - p.h, 0.0), atol=1e-7)
        violated += np.any(answer.slack > 1e-6)
    assert violated > 5


@pytest.mark.parametrize(
    ("row", "h", "width", "qd", "slack"),
    [
        # 1/2 (x - 0.5)^2 + 1000 / 2 (x - 0.1)^2 is least at x = (0.5 + 1000 * 0.1) / 1001 = 0.1003996
        (np.eye(N)[0], 0.1, 1.0, [100.5 / 1001] + [0.5] * 6, 100.5 / 1001 - 0.1),
        # a row that no joint can move is not dropped in silence
        (np.zeros(N), -0.04, 1.0, [0.5] * 7, 0.04),
        # a box without width is answered
        (np.ones(N), 0.0, 0.0, [0.3] * 7, 2.1),
    ],
)
def test_a_soft_row_gives_way_by_numbers(row: np.ndarray, h: float, width: float, qd: list[float], slack: float):
    middle = 0.3 * (width == 0.0)
    p = replace(problem(soft=True), lower=np.full(N, middle - width), upper=np.full(N, middle + width))
    answer = answered(replace(p, G=row[None], h=np.array([h])))
    assert answer.outcome is QpOutcome.SOLVED
    np.testing.assert_allclose(answer.qd, qd, rtol=1e-9)
    np.testing.assert_allclose(answer.slack, [slack], rtol=1e-6)


# no answer


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
    assert_none(answered(replace(problem(), **bad)), outcome)


# budget


@pytest.mark.parametrize("soft", [True, False])
def test_a_solve_beyond_its_budget_has_no_answer(soft: bool):
    needed = [1, 1]
    for seed in range(20):
        p = random_problem(seed, 6, soft)
        whole = answered(p)
        assert whole.outcome is QpOutcome.SOLVED
        for budget in range(1, 60):
            answer = answered(p, budget)
            if answer.outcome is QpOutcome.SOLVED:
                np.testing.assert_array_equal(answer.qd, whole.qd)
                break
            assert_none(answer, QpOutcome.FAILED)
            assert "iteration" in answer.status
        needed.append(budget)
    # some problems need more than one iteration, and none more than a few
    assert 1 < max(needed) < 50
