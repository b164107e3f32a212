"""Hard rows: the answer is DAQP's, which is another solver's, and a contradiction is one by its own weights."""

import daqp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.control.programs import answered
from tests.reference.qp import Problem

from pretouch.types import QpOutcome


def daqps(p: Problem) -> tuple[int, np.ndarray]:
    """DAQP's exit flag, 1 for solved and -1 for infeasible, and x."""
    count = len(p.h)
    x, _, flag, _ = daqp.solve(
        p.H, p.f, p.G, np.r_[p.upper, p.h], np.r_[p.lower, np.full(count, -1e30)],
        np.zeros(len(p.f) + count, np.int32), primal_tol=1e-12,
    )  # fmt: skip
    return flag, x


KINDS = ("random", "coarse", "equal", "opposite", "zeros", "narrow", "through a point", "scaled")


def problem(kind: str, seed: int) -> Problem:
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
    return Problem(H, f, lower, upper, G, h, None)


def assert_contradiction(p: Problem, multipliers: np.ndarray) -> None:
    """Farkas: bounds and rows, added up with weights >= 0, read 0 <= something negative."""
    n = len(p.f)
    box, rows = multipliers[:n], multipliers[n:]
    assert np.all(rows >= 0)
    largest = np.abs(multipliers).max()
    np.testing.assert_allclose(p.G.T @ rows + box, 0.0, rtol=0, atol=1e-9 * largest)
    assert p.h @ rows + p.upper @ np.maximum(box, 0) - p.lower @ np.maximum(-box, 0) < 0


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=200, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_it_answers_as_daqp_does(kind: str, seed: int):
    p = problem(kind, seed)
    answer, (flag, x) = answered(p), daqps(p)
    if answer.outcome is QpOutcome.INFEASIBLE:
        assert flag != 1
        assert_contradiction(p, answer.multipliers)
        return
    assert answer.outcome is QpOutcome.SOLVED
    assert np.all((p.lower <= answer.qd) & (answer.qd <= p.upper))
    assert (p.G @ answer.qd - p.h).max(initial=0.0) <= 1e-9
    # H x + f + multipliers of box and rows: what DAQP calls solved is compared, what it calls else must be optimal
    pull = p.H @ answer.qd + p.f + answer.multipliers[: len(p.f)] + p.G.T @ answer.multipliers[len(p.f) :]
    np.testing.assert_allclose(pull, 0.0, rtol=0, atol=1e-9 * (1.0 + np.abs(answer.multipliers).max()))
    if flag == 1:
        ours, theirs = (0.5 * x @ p.H @ x + p.f @ x for x in (answer.qd, x))
        assert ours == pytest.approx(theirs, rel=0, abs=1e-9)


def test_every_kind_has_problems_with_and_without_an_answer():
    outcomes = {kind: {answered(problem(kind, seed)).outcome for seed in range(60)} for kind in KINDS}
    both = {QpOutcome.SOLVED, QpOutcome.INFEASIBLE}
    assert outcomes == {kind: {QpOutcome.SOLVED} if kind == "through a point" else both for kind in KINDS}


def test_a_contradiction_names_its_rows():
    G, h = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]]), np.array([-0.2, 0.3, 0.1, 0.0])
    p = Problem(np.eye(2), np.zeros(2), -np.ones(2), np.ones(2), G, h, None)
    answer = answered(p)
    assert answer.outcome is QpOutcome.INFEASIBLE
    np.testing.assert_allclose(answer.multipliers, [0, 0, 1, 0, 1, 0])
    # x_0 <= -1.5 contradicts the lower bound of x_0
    answer = answered(Problem(p.H, p.f, p.lower, p.upper, G[:1], np.array([-1.5]), None))
    np.testing.assert_allclose(answer.multipliers, [-1, 0, 1])


def test_rows_that_miss_each_other_by_rounding_alone_do_not_contradict():
    G = np.array([[1.0, 1.0], [-1.0, -1.0], [3.0, 3.0]])
    for gap in (0.0, 1e-16, 1e-13, 1e-11):
        h = np.array([0.1, -0.1 - gap, 0.3 - gap])
        answer = answered(Problem(np.eye(2), np.ones(2), -np.ones(2), np.ones(2), G, h, None))
        assert answer.outcome is QpOutcome.SOLVED
        np.testing.assert_allclose(answer.qd, 0.05, atol=1e-10)
