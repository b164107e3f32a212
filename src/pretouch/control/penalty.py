"""A strictly convex quadratic cost within a box, with a price on rows that are violated: an exact active-set method.

    minimise  1/2 x^T H x + f^T x + w/2 sum_k max(0, G_k x - h_k)^2   subject to  lower <= x <= upper

A general solver keeps each violated soft row in its working set: with 1000 violated rows, as in a crowd, DAQP takes
0.2 s. Here a violated row only adds to the n x n Hessian, so a step costs no more than one pass over the rows. The cost
is piecewise quadratic and convex: Newton steps, each to the minimum of one piece within the box, shortened by an exact
line search where they overshoot, reach the minimum in finitely many steps.
"""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import inlined, kernel
from pretouch.modes import BUDGET, NOT_CONVEX, NOT_FINITE, SOLVED
from pretouch.types import BoolArray, FloatArray, IntArray

_ROUNDING = 1e-13
"""Relative size below which a difference is rounding."""

_REST = 1e-11
"""Length of a step below which it is the last one [rad/s]."""

_LEAST = 1e-6
"""Velocity below which rounding counts as constant [rad/s]: at a solution of 0 it would vanish."""


class QuadraticProgram(NamedTuple):
    """The problem to be minimised."""

    H: FloatArray
    """(n, n), positive definite."""
    f: FloatArray
    """(n,)."""
    lower: FloatArray
    """(n,) box."""
    upper: FloatArray
    """(n,) box."""
    G: FloatArray
    """(K, n) rows."""
    h: FloatArray
    """(K,) their bounds."""
    weight: float
    """Price w of a squared violation."""


class Minimum(NamedTuple):
    """Arrays for the solution."""

    x: FloatArray
    """(n,) minimum."""
    slack: FloatArray
    """(K,) violation of each row."""
    multipliers: FloatArray
    """(n + K,) multipliers of box and rows, positive at an upper and negative at a lower bound."""


class _Piece(NamedTuple):
    """The piece of the cost at some x: 1/2 x^T hessian x + linear^T x, and the rows (K,) violated there."""

    hessian: FloatArray
    linear: FloatArray
    violated: BoolArray


@inlined
def minimise(problem: QuadraticProgram, budget: int, answer: Minimum) -> int:
    """Write the minimum and return the ending; `budget` is the largest number of factorisations."""
    H, f, lower, upper, G, h = problem.H, problem.f, problem.lower, problem.upper, problem.G, problem.h
    x = answer.x
    if not finite(problem):
        return NOT_FINITE
    n = len(x)
    for i in range(n):
        # the middle of the box is the last command, as a rule, and close to the next one
        x[i] = 0.5 * (lower[i] + upper[i])
    which = possible_rows(G, h, lower, upper)  # slack and multipliers of all others are 0
    at_bound, piece = np.zeros(n, np.int64), _Piece(H.copy(), f.copy(), np.zeros(len(h), np.bool_))
    _take_violated(problem, which, x, piece)
    y, left = x.copy(), budget
    while True:
        # y is the minimum of the piece at x; if y is on another piece, the cost may rise again before y
        status, left = _box_minimum(piece.hessian, piece.linear, lower, upper, y, at_bound, left)
        if status != SOLVED:
            return status
        if not _differs(G, h, which, y, piece.violated):
            break
        _shorten(problem, which, x, y)
        moved = 0.0
        for i in range(n):
            moved = max(moved, abs(y[i] - x[i]) / (1.0 + abs(x[i])))
        if moved <= 1e-15:
            break  # several rows meet here: no direction leads further down
        for i in range(n):
            x[i] = y[i]
            if at_bound[i] != 0 and lower[i] < x[i] < upper[i]:
                at_bound[i] = 0  # drawn back from a bound that y had reached
        _take_violated(problem, which, x, piece)
    sound = True
    for i in range(n):
        # the box to the last digit, which rounding may miss
        x[i] = min(max(y[i], lower[i]), upper[i])
        sound = sound and np.isfinite(x[i])
    _certify(problem, piece, at_bound, answer)
    return SOLVED if sound else NOT_FINITE


@kernel
def possible_rows(G: FloatArray, h: FloatArray, lower: FloatArray, upper: FloatArray) -> IntArray:
    """Return the rows G x <= h that some x of the box violates; a problem in the box needs no others."""
    which, count = np.empty(len(h), np.int64), 0
    for k in range(len(h)):
        most = 0.0  # the largest G_k x of the box, which is at one of its corners
        for i in range(len(lower)):
            most += max(G[k, i] * lower[i], G[k, i] * upper[i])
        if not most <= h[k]:  # NaN counts as possible
            which[count] = k
            count += 1
    return which[:count]


@inlined
def finite(problem: QuadraticProgram) -> bool:
    """Return whether all numbers of a problem are finite."""
    H, f, lower, upper, G, h = problem.H, problem.f, problem.lower, problem.upper, problem.G, problem.h
    # A number that is not finite makes any sum of products with zero NaN. This comes first: in a comparison, NaN would
    # pass for a row that holds.
    total = 0.0
    for i in range(len(f)):
        total += 0.0 * f[i] + 0.0 * lower[i] + 0.0 * upper[i]
        for j in range(len(f)):
            total += 0.0 * H[i, j]
    for k in range(len(h)):
        row = 0.0 * h[k]  # a sum of its own: one after the other, all of them would wait for each other
        for i in range(len(f)):
            row += 0.0 * G[k, i]
        total += row
    return bool(total == 0.0)


@kernel
def _product(A: FloatArray, k: int, x: FloatArray, start: float) -> float:
    """Return row k of A times x, plus a start value."""
    for i in range(len(x)):
        start += A[k, i] * x[i]
    return start


@kernel
def excess_of(G: FloatArray, h: FloatArray, k: int, x: FloatArray) -> float:
    """Return the violation of row k at x; negative where it holds."""
    return _product(G, k, x, -h[k])


@kernel
def excesses(G: FloatArray, h: FloatArray, x: FloatArray, slack: FloatArray) -> None:
    """Write the violation of each row at x, zero where it holds."""
    for k in range(len(h)):
        slack[k] = max(0.0, excess_of(G, h, k, x))


@kernel
def _take_violated(problem: QuadraticProgram, which: IntArray, x: FloatArray, piece: _Piece) -> None:
    """Move the piece of the cost to x; only the rows `which` are checked."""
    H, f, G, h, weight = problem.H, problem.f, problem.G, problem.h, problem.weight
    hessian, linear, violated = piece.hessian, piece.linear, piece.violated
    n, dropped = len(x), False
    for k in which:
        dropped = dropped or (violated[k] and not excess_of(G, h, k, x) > 0)
    if dropped:
        # the subtraction of a row would leave the rounding of its large terms
        for i in range(n):
            linear[i] = f[i]
            for j in range(n):
                hessian[i, j] = H[i, j]
    for k in which:
        before = violated[k] and not dropped
        violated[k] = excess_of(G, h, k, x) > 0
        if violated[k] and not before:
            for i in range(n):
                linear[i] -= weight * h[k] * G[k, i]
                for j in range(i + 1):
                    hessian[i, j] += weight * G[k, i] * G[k, j]  # w/2 (G_k x - h_k)^2, its lower triangle
    for i in range(n):
        for j in range(i):
            hessian[j, i] = hessian[i, j]


@kernel
def _differs(G: FloatArray, h: FloatArray, which: IntArray, x: FloatArray, violated: BoolArray) -> bool:
    """Return whether x is on another piece of the cost, apart from rows that hold to rounding."""
    for k in which:
        excess = excess_of(G, h, k, x)
        if (excess > 0) != violated[k] and abs(excess) > _ROUNDING * (1.0 + abs(h[k])):
            return True
    return False


@inlined
def _shorten(problem: QuadraticProgram, which: IntArray, x: FloatArray, y: FloatArray) -> None:
    """Move y back towards x, to the minimum of the cost between both."""
    H, f, G, h, weight = problem.H, problem.f, problem.G, problem.h, problem.weight
    n, d = len(x), np.empty(len(x))
    for i in range(n):
        d[i] = y[i] - x[i]
    # between both the slope of the cost is start + t bend + w sum rate_k max(0, excess_k + t rate_k): it only rises
    start, bend = 0.0, 0.0
    for i in range(n):
        start += _product(H, i, x, f[i]) * d[i]
        bend += _product(H, i, d, 0.0) * d[i]
    excess, rate = np.empty(len(which)), np.empty(len(which))
    for m in range(len(which)):
        k = which[m]
        excess[m], rate[m] = excess_of(G, h, k, x), _product(G, k, d, 0.0)
    slope, _ = _slope(start, bend, excess, rate, weight, 1.0)
    if slope <= 0:
        return  # the cost still falls at y
    low, high, t = 0.0, 1.0, 0.5
    for _ in range(60):
        slope, rise = _slope(start, bend, excess, rate, weight, t)
        if slope > 0:
            high = t
        else:
            low = t
        after = t - slope / rise
        if abs(after - t) <= _ROUNDING:
            break
        # the zero of this piece of the slope, or half-way, if the piece ends before
        t = after if low < after < high else 0.5 * (low + high)
    for i in range(n):
        y[i] = x[i] + t * d[i]


@kernel
def _slope(
    start: float, bend: float, excess: FloatArray, rate: FloatArray, weight: float, t: float
) -> tuple[float, float]:
    """Return the slope of the cost at t on the line of `_shorten`, and its rate of change."""
    slope, rise = 0.0, 0.0
    for m in range(len(excess)):
        now = excess[m] + t * rate[m]
        if now > 0:
            slope += now * rate[m]
            rise += rate[m] * rate[m]
    return start + t * bend + weight * slope, bend + weight * rise


@kernel
def _box_minimum(
    H: FloatArray, f: FloatArray, lower: FloatArray, upper: FloatArray, x: FloatArray, at_bound: IntArray, left: int
) -> tuple[int, int]:
    """Move x within the box to the minimum of 1/2 x^T H x + f^T x, by an active-set method.

    `at_bound` (n,) marks the joints at their upper (1) or lower bound (-1). Returns the ending and the number of
    factorisations that are left.
    """
    n = len(x)
    gradient, step, L = np.empty(n), np.empty(n), np.empty((n, n))
    free, last = np.empty(n, np.int64), np.inf
    while left > 0:
        left -= 1
        size, count = 0.0, 0
        for i in range(n):
            gradient[i], terms = f[i], abs(f[i])
            for j in range(n):
                gradient[i] += H[i, j] * x[j]
                terms += abs(H[i, j]) * max(abs(x[j]), _LEAST)
            size = max(size, terms)
            if at_bound[i] == 0:
                free[count] = i
                count += 1
        if not _newton_step(H, gradient, free[:count], L, step):
            return NOT_CONVEX, left
        # as far as the box allows, up to the first joint that meets its bound
        t, block, length = 1.0, -1, 0.0
        for i in free[:count]:
            length = max(length, abs(step[i]))
            room = (upper[i] if step[i] > 0 else lower[i]) - x[i]
            if abs(step[i]) * t > abs(room):
                t, block = abs(room) / abs(step[i]), i
        for i in free[:count]:
            x[i] += t * step[i]
        if block >= 0:
            at_bound[block] = 1 if step[block] > 0 else -1
            x[block] = upper[block] if step[block] > 0 else lower[block]
            last = np.inf
        elif length > _REST and length < 0.5 * last:
            # a second step removes the rounding of the first
            last = length
        else:
            # release the bound with the largest pull, if any
            pull, most = _ROUNDING * size, -1
            for i in range(n):
                if at_bound[i] * gradient[i] > pull:
                    pull, most = at_bound[i] * gradient[i], i
            if most < 0:
                return SOLVED, left
            at_bound[most], last = 0, np.inf
    return BUDGET, left


@kernel
def _newton_step(H: FloatArray, gradient: FloatArray, free: IntArray, L: FloatArray, step: FloatArray) -> bool:
    """Solve H step = -gradient for the free joints by a Cholesky factor L; False if H is not positive definite."""
    m = len(free)
    part, pull = np.empty((m, m)), np.empty(m)
    for a in range(m):
        pull[a] = -gradient[free[a]]
        for b in range(a + 1):
            part[a, b] = H[free[a], free[b]]
    if not factor(part, L):
        return False
    forward(L, pull, pull)
    backward(L, pull, pull)
    for a in range(m):
        step[free[a]] = pull[a]
    return True


@inlined
def _certify(problem: QuadraticProgram, piece: _Piece, at_bound: IntArray, answer: Minimum) -> None:
    """Write slack (K,) and multipliers (n + K,) of the minimum x."""
    hessian, linear, x, slack, multipliers = piece.hessian, piece.linear, answer.x, answer.slack, answer.multipliers
    n = len(x)
    excesses(problem.G, problem.h, x, slack)
    for k in range(len(problem.h)):
        multipliers[n + k] = problem.weight * slack[k]  # derivative of w/2 s^2
    for i in range(n):
        pull = _product(hessian, i, x, linear[i])
        # H x + f + G^T (w s) + multiplier = 0 at the minimum; the max removes a wrong sign by rounding
        multipliers[i] = at_bound[i] * max(0.0, -at_bound[i] * pull)
