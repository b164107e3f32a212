"""Quadratic programs of the reference given to the product's solver, and its answer where there is none."""

import numpy as np
from tests.reference.qp import Problem

from pretouch.control.qp import ApproachRows, Cost, solve
from pretouch.types import QpOutcome, QpSolution

STOP = 0.0123
"""Braking command of each joint."""


def answered(p: Problem, budget: int = 500) -> QpSolution:
    """The answer of the product's solver."""
    rows = ApproachRows(p.G, p.h, p.weight is not None)
    return solve(Cost(p.H, p.f), p.lower, p.upper, rows, p.weight or 1.0, np.full(len(p.f), STOP), budget)


def assert_braking(answer: QpSolution, p: Problem, outcome: QpOutcome) -> None:
    """There is no answer for this reason, and the command is that of braking."""
    assert answer.outcome is outcome
    assert answer.status
    np.testing.assert_array_equal(answer.qd, STOP)
    assert answer.slack.shape == p.h.shape
    if outcome is QpOutcome.INFEASIBLE:
        np.testing.assert_allclose(answer.slack, np.maximum(p.G @ answer.qd - p.h, 0.0), atol=1e-12)
    assert answer.multipliers.shape == (len(p.f) + len(p.h),)
    assert np.all(np.isfinite(answer.multipliers))
