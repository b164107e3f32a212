"""A strictly convex quadratic cost within a box and rows that must hold: a dual active-set method.

    minimise  1/2 x^T H x + f^T x   subject to  lower <= x <= upper,  G x <= h

Goldfarb and Idnani (1983): from the unconstrained minimum on, the most violated bound is added to those in force, and
those are dropped whose multipliers fall to zero on the way. Each step raises the cost, so no set in force comes twice.
Where a bound cannot be added, it and those in force contradict each other, and the answer gives the weights.

Bounds are a^T x <= b with |a| = 1: n upper and n lower ones of the box, then rows that some x of the box violates. With
H = L L^T and y = L^T x the cost is 1/2 |y - y_0|^2, and a bound has the normal L^-1 a.
"""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import kernel
from pretouch.control.penalty import Minimum, QuadraticProgram, excess_of, excesses, finite, possible_rows
from pretouch.modes import BUDGET, INFEASIBLE, NOT_CONVEX, NOT_FINITE, SOLVED
from pretouch.types import FloatArray, IntArray

_MET = 1e-12
"""Excess on a bound up to which it holds [rad/s]: rounding."""

_CONTRADICTION = 1e-10
"""Excess up to which a bound holds whose normal is a combination of those in force [rad/s]."""

_DEPENDENT = 1e-8
"""Sine of the angle, in y, between a normal and those in force below which it is a combination of them."""

_FALLS = 1e-12
"""Rate above which a multiplier falls while that of the added bound rises by one."""

_SHORT = 1e-12
"""Length of a row up to which no joint moves its point [m]."""


class _Force(NamedTuple):
    """The m bounds in force, up to n, and behind them the one that is being added."""

    bound: IntArray
    """(n + 1,) indices among all bounds."""
    multiplier: FloatArray
    """(n + 1,)"""
    normal: FloatArray
    """(n, n) their normals in y, one a row: the columns of Q^T R."""
    Q: FloatArray
    """(n, n) orthonormal rows."""
    R: FloatArray
    """(n, n) upper triangle."""
    from_excess: FloatArray
    """(2 n + R,) excess from which a bound counts as violated [rad/s]: infinite while it is in force."""


@kernel
def minimise_within(problem: QuadraticProgram, budget: int, answer: Minimum) -> int:
    """Write the minimum and return the ending; `budget` counts the bounds that are added or dropped.

    The weight of the problem does not count. Without a solution, the multipliers are weights of bounds and rows that
    contradict each other: their weighted sum is 0 <= a negative number.
    """
    n, L = len(problem.f), np.empty_like(problem.H)
    answer.multipliers[:] = 0.0
    if not finite(problem):
        return NOT_FINITE
    if not factor(problem.H, L):
        return NOT_CONVEX
    which = possible_rows(problem.G, problem.h, problem.lower, problem.upper)
    A, b, size = np.zeros((2 * n + len(which), n)), np.empty(2 * n + len(which)), np.ones(2 * n + len(which))
    source, count = np.empty(len(b), np.int64), 2 * n
    for i in range(n):
        A[i, i], A[n + i, i], b[i], b[n + i] = 1.0, -1.0, problem.upper[i], -problem.lower[i]
        source[i], source[n + i], size[n + i] = i, i, -1.0  # a multiplier at a lower bound is negative
    for k in which:
        length = np.sqrt(sum(problem.G[k] ** 2))
        if length > _SHORT:
            A[count], b[count] = problem.G[k] / length, problem.h[k] / length
            source[count], size[count] = n + k, length
            count += 1
        elif problem.h[k] < -_MET:
            answer.multipliers[n + k] = 1.0
            return INFEASIBLE
    bound, normal, Q = np.empty(n + 1, np.int64), np.empty((n + 1, n)), np.empty((n, n))
    force = _Force(bound, np.zeros(n + 1), normal, Q, np.zeros((n, n)), np.full(count, _MET))
    ending, m = _search(L, problem.f, A, b[:count], force, budget, answer.x)
    for j in range(m):
        c = force.bound[j]
        answer.multipliers[source[c]] += force.multiplier[j] / size[c]
    for i in range(n):
        answer.x[i] = min(max(answer.x[i], problem.lower[i]), problem.upper[i])  # the box to the last digit
    excesses(problem.G, problem.h, answer.x, answer.slack)
    return ending


@kernel
def _search(
    L: FloatArray, f: FloatArray, A: FloatArray, b: FloatArray, force: _Force, budget: int, x: FloatArray
) -> tuple[int, int]:
    """Write the minimum to x (n,); return the ending, and the number of bounds in force or in contradiction."""
    n, m, weight = len(f), 0, force.multiplier
    room = np.empty((4, n))
    least, y, rest, r = room[0], room[1], room[2], room[3]
    forward(L, -f, least)
    y[:] = least
    while True:
        backward(L, y, x)
        bound, excess = _most_violated(A, b, x, force.from_excess)
        if bound < 0:
            return SOLVED, m
        force.bound[m], weight[m] = bound, 0.0
        forward(L, A[bound], force.normal[m])
        while True:
            if budget <= 0:
                return BUDGET, 0
            budget -= 1
            # while the multiplier of the bound rises by t, y moves by -t rest, and the others rise by -t r
            height = _split(force, m, r, rest)
            if height == 0.0 and excess <= _CONTRADICTION:
                force.from_excess[bound] = _CONTRADICTION
                break
            t, first = excess / height**2 if height > 0.0 else np.inf, -1
            for j in range(m):
                if r[j] > _FALLS and weight[j] < t * r[j]:
                    t, first = weight[j] / r[j], j
            if t == np.inf:
                for j in range(m):
                    weight[j] = max(0.0, -r[j])
                weight[m] = 1.0
                return INFEASIBLE, m + 1
            if first < 0:
                _bar(force, bound, n, np.inf)
                m += 1
                _settle(b, force, m, least, y)
                break
            excess = max(0.0, excess - t * height**2)
            for j in range(m):
                weight[j] = max(0.0, weight[j] - t * r[j])
            weight[m] += t
            _drop(force, m, first, r, rest)
            m -= 1


@kernel
def _most_violated(A: FloatArray, b: FloatArray, x: FloatArray, from_excess: FloatArray) -> tuple[int, float]:
    """Return the most violated bound, -1 for none, and its excess [rad/s]."""
    worst, most = -1, 0.0
    for c in range(len(b)):
        excess = excess_of(A, b, c, x)
        if excess > most and excess > from_excess[c]:
            worst, most = c, excess
    return worst, most


@kernel
def _split(force: _Force, m: int, r: FloatArray, rest: FloatArray) -> float:
    """Write the normal of bound m as a sum of r_j times those before it and `rest`, and column m of Q and R.

    Returns the length of `rest` (n,), 0 where the normal is a combination of those before it.
    """
    normal, Q, R, n = force.normal, force.Q, force.R, len(rest)
    for i in range(n):
        rest[i] = normal[m, i]
    size = np.sqrt(sum(rest * rest))
    r[:m] = 0.0
    for _ in range(2):  # twice is enough (Giraud et al. 2005)
        for j in range(m):
            along = 0.0
            for i in range(n):
                along += Q[j, i] * rest[i]
            for i in range(n):
                rest[i] -= along * Q[j, i]
            r[j] += along
    height = np.sqrt(sum(rest * rest))
    if m < n and height > 0.0:
        for j in range(m):
            R[j, m] = r[j]
        R[m, m] = height
        for i in range(n):
            Q[m, i] = rest[i] / height
    for j in range(m - 1, -1, -1):  # R r = Q normal
        for k in range(j + 1, m):
            r[j] -= R[j, k] * r[k]
        r[j] /= R[j, j]
    return height if m < n and height > _DEPENDENT * size else 0.0


@kernel
def _settle(b: FloatArray, force: _Force, m: int, least: FloatArray, y: FloatArray) -> None:
    """Compute y and the multipliers anew for the m bounds in force, so that rounding does not accumulate."""
    n, Q, R, weight, reach = len(y), force.Q, force.R, force.multiplier, np.empty(m)
    y[:] = least
    for j in range(m):
        reach[j] = b[force.bound[j]]
        for k in range(j):
            reach[j] -= R[k, j] * reach[k]
        reach[j] /= R[j, j]  # Q y = R^-T b
        weight[j] = -reach[j]
        for i in range(n):
            weight[j] += Q[j, i] * least[i]
        for i in range(n):
            y[i] -= weight[j] * Q[j, i]
    for j in range(m - 1, -1, -1):  # y + Q^T R weight = least
        for k in range(j + 1, m):
            weight[j] -= R[j, k] * weight[k]
        weight[j] /= R[j, j]
    for j in range(m):
        weight[j] = max(0.0, weight[j])


@kernel
def _drop(force: _Force, m: int, first: int, r: FloatArray, rest: FloatArray) -> None:
    """Drop bound `first` of the m bounds in force."""
    _bar(force, force.bound[first], len(rest), _MET)
    for j in range(first, m):
        force.bound[j], force.multiplier[j] = force.bound[j + 1], force.multiplier[j + 1]
        for i in range(len(rest)):
            force.normal[j, i] = force.normal[j + 1, i]
    for j in range(first, m - 1):
        _split(force, j, r, rest)


@kernel
def _bar(force: _Force, bound: int, n: int, excess: float) -> None:
    """Set the excess from which a bound counts as violated; for one of the box, that of the opposite bound too."""
    force.from_excess[bound] = excess
    if bound < 2 * n:
        force.from_excess[(bound + n) % (2 * n)] = excess
