"""Quadratic programs with many rows: redundant, repeated, parallel, empty, contradicting, and such as just touch."""

from dataclasses import replace

import numpy as np

from tests.reference.qp import Problem, solve

N = 7
WEIGHT = 1000.0
TOUCH = (0.0, 1e-12, -1e-12, 1e-9, -1e-9, 1e-7, -1e-7, 1e-5, -1e-5, 1e-3, -1e-3)
"""How far a row lies from what it touches: rows that a bound must keep, or may leave out, by a hair."""


def problem(seed: int, count: int, soft: bool, feasible: bool = True) -> Problem:
    """A problem like those of a control step: a task of 6 in 7 joints, a small box, `count` rows of every kind."""
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(6, N)) * rng.uniform(0.2, 1.0) * np.where(rng.random(N) < 0.2, 0.05, 1.0)
    H = J.T @ J + 1e-3 * np.eye(N)
    middle, half = rng.uniform(-1.0, 1.0, N), rng.choice([0.01, 0.1, 0.3, 2.0]) * rng.uniform(0.3, 1.0, N)
    lower, upper = middle - half, middle + half
    wanted = rng.uniform(-2.0, 2.0, N)
    # in the last case the task lies in a corner of the box, where rows that touch the corner decide
    corner = np.where(rng.random(N) < 0.5, lower, upper)
    f = -H @ (wanted if rng.random() < 0.6 else corner + rng.uniform(0, 1) * (corner - middle))
    inside = middle + half * rng.uniform(-0.9, 0.9, N)
    rows = [_row(rng, lower, upper, inside, feasible or soft, not soft) for _ in range(count)]
    G, h = np.reshape([g for g, _ in rows], (-1, N)), np.array([bound for _, bound in rows])
    G, h = _echoes(rng, G, h, feasible or soft)
    p = Problem(H, f, lower, upper, G, h, WEIGHT if soft else None)
    return p if feasible or soft or count == 0 else _contradicted(rng, p)


def _row(
    rng: np.random.Generator, lower: np.ndarray, upper: np.ndarray, inside: np.ndarray, feasible: bool, hard: bool
) -> tuple[np.ndarray, float]:
    g = rng.normal(size=N) * rng.choice([0.05, 0.3, 1.0]) * (rng.random(N) < 0.8)
    reach = np.maximum(g * lower, g * upper).sum()
    kind = rng.random()
    if kind < 0.5:  # can never be violated in the box
        return g, reach + rng.uniform(0.0, 1.0)
    if kind < 0.7:  # touches the box in one corner
        return g, max(reach + rng.choice(TOUCH), g @ inside + 1e-5 if feasible else -np.inf)
    if kind < 0.75:  # no joint moves it, or hardly any
        return 1e-8 * g * (rng.random() < 0.5), rng.uniform(0.001, 0.1) if hard else rng.uniform(-0.02, 0.1)
    return g, g @ inside + rng.uniform(0.0, 1.0) ** 2 * (reach - g @ inside)


def _echoes(rng: np.random.Generator, G: np.ndarray, h: np.ndarray, feasible: bool) -> tuple[np.ndarray, np.ndarray]:
    """Make some rows copies of others: the same, parallel, nearly parallel."""
    G, h = G.copy(), h.copy()
    for i in np.flatnonzero(rng.random(len(h)) < 0.2):
        of, times = int(rng.integers(len(h))), rng.choice([1.0, 1.0, 0.5, 3.0])
        G[i], h[i] = times * G[of], times * h[of] + rng.choice([0.0, 0.0, 1e-3, 0.1])
        if rng.random() < 0.3:
            # a little more room for the little turn, so that what was feasible stays so
            G[i] += 1e-3 * rng.normal(size=N)
            h[i] += 0.1 if feasible else 0.0
    return G, h


def _contradicted(rng: np.random.Generator, p: Problem) -> Problem:
    """Let one row ask for what the box or another row forbids."""
    G, h = p.G.copy(), p.h.copy()
    i, g = int(rng.integers(len(h))), rng.normal(size=N)
    gap = rng.choice([1e-5, 1e-3, 0.1])
    if len(h) > 1 and rng.random() < 0.5:
        G[i - 1], h[i - 1] = g, g @ (p.lower + p.upper) / 2
        G[i], h[i] = -g, -h[i - 1] - gap
    else:
        G[i], h[i] = g, np.minimum(g * p.lower, g * p.upper).sum() - gap
    return replace(p, G=G, h=h)


def grazed(p: Problem, seed: int, gap: float) -> Problem:
    """Add three rows that the answer meets by `gap` [m/s], or misses by it if it is negative."""
    answer = solve(p)
    G = np.random.default_rng(seed).normal(size=(3, N))
    return p if answer.x is None else replace(p, G=np.vstack([p.G, G]), h=np.append(p.h, G @ answer.x + gap))


def stiff_row(seed: int, soft: bool, gap: float) -> Problem:
    """One row that the free minimum misses by `gap` [m/s], so turned that the answer moves farthest to meet it.

    Meeting a row g by d moves the answer by d H^-1 g / (g' H^-1 g): much, where g is mostly stiff but not all of it.
    """
    p = problem(seed, 0, soft)
    stiffness, directions = np.linalg.eigh(p.H)
    g = np.sqrt(stiffness[0]) * (directions[:, 0] + directions[:, -1])
    g *= 0.1 / np.linalg.norm(g)
    free = np.linalg.solve(p.H, -p.f)
    return replace(p, lower=free - 1, upper=free + 1, G=g[None], h=np.array([g @ free - gap]))


def facing_rows(seed: int, angle: float) -> Problem:
    """Two hard rows that face each other but for a small angle, and leave a wedge into whose edge the task presses."""
    p, rng = problem(seed, 0, soft=False), np.random.default_rng(seed)
    plane, _ = np.linalg.qr(rng.normal(size=(N, 2)))
    g, e = plane.T
    edge = rng.uniform(-0.2, 0.2, N)
    G = np.array([g, -(g + angle * e)])
    return replace(
        p, f=-p.H @ (edge - 2.0 * e + 0.5 * g), lower=np.full(N, -5.0), upper=np.full(N, 5.0), G=G, h=G @ edge
    )
