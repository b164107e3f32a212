"""An exact solver for the quadratic program, and the conditions its answers are held to.

min 1/2 x'H x + f'x + w/2 sum max(0, G x - h)^2 in lower <= x <= upper (soft), or with G x <= h (hard).

Both are written as rows A x - C lambda <= b with lambda >= 0 the multiplier of each row and C its compliance: 1/w for a
soft row, which so gives way by lambda / w, and 0 for a hard row or a side of the box.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

_MET = 1e-13
"""A row violated by less than this counts as met: rounding of the largest terms."""

_REACHED = 1e-6
"""How near to what is wanted counts as reached: of 1, 0.05 is missed where rows can be met, 1e-8 where not."""


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
    """Find which rows are in force by least squares that are not negative, then solve them in extended precision.

    With H = L L' and z = L' x + L^-1 f, beside what soft rows give way, the minimum is the shortest z with G z >= h. By
    Lawson and Hanson it follows from the y >= 0 that brings G' y nearest to 0 and h' y to 1: where it reaches both, no
    z meets the rows, and y proves it.
    """
    A, b, C = p.rows()
    free = np.linalg.solve(p.H, -p.f)
    gives = np.diag(np.sqrt(C))[:, C > 0]
    G, h = np.hstack([-np.linalg.solve(np.linalg.cholesky(p.H), A.T).T, gives]), A @ free - b
    wanted = np.append(np.zeros(G.shape[1]), 1.0)
    y, _ = nnls(np.vstack([G.T, h]), wanted, maxiter=100 * len(b))
    if np.abs(np.vstack([G.T, h]) @ y - wanted).max() < _REACHED:
        return Answer(None, y)
    return _polished(p, A, b, C, np.flatnonzero(y > 0).tolist())


def _polished(p: Problem, A: np.ndarray, b: np.ndarray, C: np.ndarray, force: list[int]) -> Answer:
    """Solve with the rows in force; one that holds nothing is let go, one that is missed by rounding is taken in."""
    for _ in range(10 * len(b)):
        x, lam = _held(p, A, b, C, force)
        missed = A @ x - b - C * lam
        missed[force] = -np.inf
        row = int(np.argmax(missed))
        if np.any(lam < 0):
            force = [i for i in force if i != np.argmin(lam)]
        elif missed[row] > _MET and np.linalg.matrix_rank(np.hstack([A, np.diag(C)])[[*force, row]]) > len(force):
            force = [*force, row]
        elif missed[row] > _MET:  # as many rows as joints meet in it: it takes the place of one of them
            others = ([i for i in force if i != out] + [row] for out in force)
            force = next(other for other in others if np.all(_held(p, A, b, C, other)[1] >= 0))
        else:
            n = len(x)
            return Answer(np.clip(x, p.lower, p.upper), np.concatenate([lam[:n] - lam[n : 2 * n], lam[2 * n :]]))
    raise ArithmeticError("the reference solver does not end")


def _held(p: Problem, A: np.ndarray, b: np.ndarray, C: np.ndarray, force: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Minimum and multipliers where these rows are met to the point, and no others looked at."""
    K = np.block([[p.H, A[force].T], [A[force], -np.diag(C[force])]])
    z, lam = _refined(K, np.concatenate([-p.f, b[force]])), np.zeros(len(b))
    lam[force] = z[len(p.f) :]
    return z[: len(p.f)], lam


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
