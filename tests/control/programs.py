"""Quadratic programs of the reference given to the product's solvers."""

import numpy as np
from tests.reference.qp import Problem

from pretouch.control.active_set import minimise_within
from pretouch.control.penalty import Minimum, QuadraticProgram, minimise
from pretouch.control.task import cost_into
from pretouch.modes import outcome_of
from pretouch.params import TaskParams
from pretouch.types import FloatArray, QpSolution

_NONE = np.zeros(0)


def answered(p: Problem, budget: int = 500) -> QpSolution:
    """The answer of the product's solver: of soft rows, which have a price, or of hard ones."""
    n, count, weight = len(p.f), len(p.h), p.weight or 0.0
    least = Minimum(np.zeros(n), np.zeros(count), np.zeros(n + count))
    solver = minimise if weight else minimise_within
    ending = solver(QuadraticProgram(p.H, p.f, p.lower, p.upper, p.G, p.h, weight), budget, least)
    return QpSolution(*least, *outcome_of(False, ending, weight > 0.0 and bool(least.slack.max(initial=0.0) > 0.0)))


def task_cost(
    J: FloatArray, x_d: FloatArray, q: FloatArray, q_mid: FloatArray, params: TaskParams, z: FloatArray = _NONE
) -> tuple[FloatArray, FloatArray]:
    """H (n, n) and f (n,) of the cost of eq. 2; with a motion z (n,) for the null space."""
    H, f = np.empty((len(q), len(q))), np.empty(len(q))
    cost_into(J, x_d, q, q_mid, params.numbers, z, H, f)
    return H, f
