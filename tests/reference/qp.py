"""An exact solver for the quadratic program, and the conditions its answers are held to.

min 1/2 x'H x + f'x + w/2 sum max(0, G x - h)^2 in lower <= x <= upper (soft), or with G x <= h (hard).

Both are written as rows A x - C lambda <= b with lambda >= 0 the multiplier of each row and C its compliance: 1/w for a
soft row, which so gives way by lambda / w, and 0 for a hard row or a side of the box.
"""

from dataclasses import dataclass

import numpy as np

_MET = 1e-13
"""A row violated by less than this counts as met: rounding of the largest terms."""

_DEPENDENT = 1e-8
"""Sine of the angle between a hard row and the span of those in force below which it counts as one of them."""


@dataclass(frozen=True)
class Problem:
    """One quadratic program."""

    H: np.ndarray
    f: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    G: np.ndarray
    h: np.ndarray
    weight: float | None
    """Weight of the squared violation of a row, None for hard rows."""

    def rows(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, b and C of upper box, lower box and rows."""
        n, count = len(self.f), len(self.h)
        compliance = 0.0 if self.weight is None else 1.0 / self.weight
        return (
            np.vstack([np.eye(n), -np.eye(n), self.G.reshape(count, n)]),
            np.concatenate([self.upper, -self.lower, self.h]),
            np.concatenate([np.zeros(2 * n), np.full(count, compliance)]),
        )


@dataclass(frozen=True)
class Answer:
    """The minimum, or a proof that there is none."""

    x: np.ndarray | None
    """(n,) the minimum, None where the rows contradict each other."""
    multipliers: np.ndarray
    """(n + K,) positive at an upper, negative at a lower bound. Without an answer (2 n + K,), Farkas' y: y >= 0,
    A'y = 0 and b'y < 0."""


def solve(p: Problem) -> Answer:
    """Goldfarb and Idnani's dual method: from the free minimum, take the most violated row in until none is.

    Every step raises the dual objective, so no set of rows in force comes twice and the method ends. The last set is
    solved once more, from nothing, with residuals in extended precision.
    """
    A, b, C = p.rows()
    x, lam, force = np.linalg.solve(p.H, -p.f), np.zeros(len(b)), []
    for _ in range(50 * (len(b) + 10)):
        violation = A @ x - b - C * lam
        violation[force] = -np.inf
        row = int(np.argmax(violation))
        if violation[row] <= _MET:
            return _polished(p, A, b, C, force)
        contradiction = _take_in(p.H, p.f, A, b, C, row, force, x, lam)
        if contradiction is not None:
            return Answer(None, contradiction)
    raise ArithmeticError("the reference solver does not end")


def _take_in(
    H: np.ndarray, f: np.ndarray, A: np.ndarray, b: np.ndarray, C: np.ndarray, row: int, force: list[int],
    x: np.ndarray, lam: np.ndarray,
) -> np.ndarray | None:  # fmt: skip
    """Raise the multiplier of `row` until the row is met, letting go of rows whose multiplier falls to zero.

    `x`, `lam` and `force` are changed. Returns Farkas' y where the row cannot be met.
    """
    n = len(x)
    while True:
        K = _kkt(H, A[force], C[force])
        move = np.linalg.solve(K, np.concatenate([-A[row], np.zeros(len(force))]))
        dx, dlam = move[:n], move[n:]
        yielding = C[row] - A[row] @ dx
        dependent = C[row] == 0 and (yielding <= 0 or _depends(A[row], A[[i for i in force if C[i] == 0]]))
        violation = A[row] @ x - b[row] - C[row] * lam[row]
        full = np.inf if dependent else max(violation, 0.0) / yielding
        falling = [(lam[i] / -d, i) for i, d in zip(force, dlam, strict=True) if d < -1e-12]
        part, first = min(falling, default=(np.inf, -1))
        if np.isinf(min(full, part)):
            y = np.zeros(len(b))
            y[row], y[force] = 1.0, np.maximum(dlam, 0.0)
            return y
        t = min(full, part)
        if not dependent:
            x += t * dx
        lam[row] += t
        lam[force] += t * dlam
        if full <= part:
            force.append(row)
            # afresh from the rows in force, so that rounding does not add up
            z = _refined(_kkt(H, A[force], C[force]), np.concatenate([-f, b[force]]))
            x[:], lam[force] = z[:n], np.maximum(z[n:], 0.0)
            return None
        lam[first] = 0.0
        force.remove(first)


def _depends(row: np.ndarray, others: np.ndarray) -> bool:
    if len(others) == len(row):
        return True
    size = np.linalg.norm(row)
    rest = row - others.T @ np.linalg.lstsq(others.T, row, rcond=None)[0] if len(others) else row
    return bool(size == 0 or np.linalg.norm(rest) <= _DEPENDENT * size)


def _kkt(H: np.ndarray, A: np.ndarray, C: np.ndarray) -> np.ndarray:
    return np.block([[H, A.T], [A, -np.diag(C)]])


def _polished(p: Problem, A: np.ndarray, b: np.ndarray, C: np.ndarray, force: list[int]) -> Answer:
    n, lam = len(p.f), np.zeros(len(b))
    while True:
        z = _refined(_kkt(p.H, A[force], C[force]), np.concatenate([-p.f, b[force]]))
        if np.all(z[n:] >= 0):
            break
        # rows that meet in one point within rounding: one of them holds nothing
        force = [row for i, row in enumerate(force) if i != np.argmin(z[n:])]
    lam[force] = z[n:]
    return Answer(np.clip(z[:n], p.lower, p.upper), np.concatenate([lam[:n] - lam[n : 2 * n], lam[2 * n :]]))


def _refined(K: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve K z = right with the residual in extended precision."""
    z = np.linalg.solve(K, right).astype(np.longdouble)
    for _ in range(3):
        z = z + np.linalg.solve(K, (right - K.astype(np.longdouble) @ z).astype(np.float64))
    return z.astype(np.float64)


def kkt_residual(p: Problem, x: np.ndarray, multipliers: np.ndarray) -> float:
    """Largest violation of the conditions of Karush, Kuhn and Tucker, each by its natural scale; 0 at the minimum.

    - stationarity H x + f + lambda_box + G' lambda_rows = 0, by the largest single term of it,
    - feasibility of the box, by the largest speed in it, and of hard rows, by the largest term of G x <= h,
    - sign of a row's multiplier, by the largest multiplier,
    - complementarity of a hard bound: multiplier times distance to the bound, by both of the scales above,
    - a soft row's multiplier is weight times its slack: the difference, by weight times the rows' scale.

    `multipliers` (n + K,) are positive at an upper and negative at a lower bound.
    """
    n = len(x)
    on_box, on_rows = multipliers[:n], multipliers[n:]
    terms = [p.H * x, p.f[:, None], on_box[:, None], p.G.T * on_rows]
    largest = max(float(np.abs(t).max(initial=0.0)) for t in terms)
    parts = [np.abs(sum(t.sum(axis=1) for t in terms)).max() / _or_one(largest)]
    speed = _or_one(float(np.abs([p.lower, p.upper]).max()))
    force = _or_one(float(np.abs(multipliers).max()))
    above, below = x - p.upper, p.lower - x
    parts += [above.max() / speed, below.max() / speed]
    parts.append((np.maximum(on_box, 0) * np.abs(above)).max() / force / speed)
    parts.append((np.maximum(-on_box, 0) * np.abs(below)).max() / force / speed)
    if len(on_rows):
        excess = p.G @ x - p.h
        scale = _or_one(float(max(np.abs(p.G * x).max(), np.abs(p.h).max())))
        parts.append((-on_rows).max() / force)
        if p.weight is None:
            parts += [excess.max() / scale, np.abs(on_rows * excess).max() / force / scale]
        else:
            parts.append(np.abs(on_rows - p.weight * np.maximum(excess, 0.0)).max() / p.weight / scale)
    return float(max(parts))


def _or_one(scale: float) -> float:
    return scale if scale > 0 else 1.0
