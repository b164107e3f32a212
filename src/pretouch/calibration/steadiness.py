"""Whether a unit stayed where it was: two poses, before and after any instant, against one.

Linearised at the one pose, a small solve tells for each instant how much better two poses explain what was measured (a
generalised likelihood ratio). At the best instant both poses are fitted together, all errors of the IMU shared, and
what lies between them is compared with its covariance.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.calibration.fit import PLACE, TURN, Estimate, Measured, Problem
from pretouch.calibration.link_motion import LinkMotion
from pretouch.calibration.locate import sizes
from pretouch.calibration.params import CalibrationParams
from pretouch.types import FloatArray

_WORTH = 30.0
"""Twice the gain of log-likelihood from which on two poses are fitted: less is chance."""
_SIGNIFICANT = 30.0
"""Squared size, in standard deviations, from which on a difference of three numbers is a slip: chance gives it once in
700 000 times."""
_EDGE_BLOCKS = 6
"""Blocks at either end of the run in which no slip is looked for: fewer do not tell how sure their pose is."""
_ITERATIONS = 6
_APART = np.repeat((0.5, 0.1), 3)
"""Standard deviation of a slip before anything is measured [rad, m]: keeps what a part does not tell finite."""
_POSE = len(_APART)


@dataclass(frozen=True)
class Slip:
    """A unit that sat elsewhere from some instant on."""

    earliest: float
    """[s]"""
    latest: float
    """[s]"""
    distance: float
    """[m]"""
    angle: float
    """[rad]"""


@dataclass(frozen=True, eq=False)
class Course:
    """What is known of one unit at N instants, outliers included."""

    time: FloatArray
    """(N,) [s]."""
    motion: LinkMotion
    measured: Measured
    noise: FloatArray
    """(6,) standard deviation of what is not explained [rad/s, m/s^2]."""


def find_slip(course: Course, estimate: Estimate, params: CalibrationParams) -> Slip | None:
    """Find whether and when a unit slipped, from the estimate of one pose for the whole run."""
    per_block = max(1, round(params.block_s * params.rate_hz))
    first, gain = _best_split(_Rows(course, estimate, params), per_block)
    if gain < _WORTH:
        return None
    before, after, first = _two_poses(course, estimate, first, per_block, params)
    return _compared(course, before, after, first, per_block, params)


class _Rows:
    """Jacobian and residuals of one estimate, where what is beyond tolerance counts in proportion to its size only."""

    def __init__(self, course: Course, estimate: Estimate, params: CalibrationParams) -> None:
        problem = Problem(course.motion, course.measured, estimate, course.noise, params)
        x = np.concatenate([np.zeros(_POSE), estimate.rest])
        unknowns, N = len(x), len(course.time)
        J, residuals = problem.jacobian(x), problem.residuals(x)
        tolerated = np.array([params.tolerated_angular_velocity, params.tolerated_acceleration])
        size = sizes(residuals[:-unknowns].reshape(N, 6) * course.noise)
        weight = np.repeat(np.sqrt(np.minimum(1.0, tolerated / np.maximum(size, 1e-12))), 3, axis=1)
        self.J: FloatArray = J[:-unknowns].reshape(N, 6, unknowns) * weight[:, :, None]
        self.residuals: FloatArray = residuals[:-unknowns].reshape(N, 6) * weight
        self.prior_J: FloatArray = J[-unknowns:]
        self.prior_residuals: FloatArray = residuals[-unknowns:]


def _best_split(rows: _Rows, per_block: int) -> tuple[int, float]:
    """Return the first instant of the second part at which two poses are the most likely, and how much that gains."""
    N = len(rows.J)
    begins = np.arange(0, N, per_block)
    information = np.add.reduceat(np.einsum("nij,nik->njk", rows.J, rows.J), begins, axis=0)
    gradient = np.add.reduceat(-np.einsum("nij,ni->nj", rows.J, rows.residuals), begins, axis=0)
    inverse = np.linalg.inv(information.sum(axis=0) + rows.prior_J.T @ rows.prior_J)
    step = inverse @ (gradient.sum(axis=0) - rows.prior_J.T @ rows.prior_residuals)
    block = np.arange(len(begins))
    allowed = (block >= _EDGE_BLOCKS) & (block <= len(begins) - _EDGE_BLOCKS)
    if not allowed.any():
        return 0, 0.0
    after = np.cumsum(information[::-1], axis=0)[::-1][allowed][:, :, :_POSE]
    pull = np.cumsum(gradient[::-1], axis=0)[::-1][allowed][:, :_POSE] - step @ after
    remaining = after[:, :_POSE] - after.swapaxes(1, 2) @ inverse @ after + np.diag(_APART**-2.0)
    gain = np.einsum("ki,ki->k", pull, np.linalg.solve(remaining, pull[:, :, None])[:, :, 0])
    best = int(np.argmax(gain))
    return int(begins[allowed][best]), float(gain[best])


def _two_poses(
    course: Course, estimate: Estimate, first: int, per_block: int, params: CalibrationParams
) -> tuple[Estimate, Estimate, int]:
    """Fit a pose before and one after some instant, by Gauss and Newton, and that instant with them."""
    before = after = estimate
    for _ in range(_ITERATIONS):
        early, late = _Rows(course, before, params), _Rows(course, after, params)
        if before is not after:
            first = int(np.argmin(_costs(early, late, per_block)))
        J, residuals = _joined(early, late, first)
        step = np.linalg.lstsq(J, -residuals, rcond=None)[0]
        rest = before.rest + step[_POSE:-_POSE]
        before, after = (
            e.moved(np.concatenate([d, rest])) for e, d in ((before, step[:_POSE]), (after, step[-_POSE:]))
        )
    return before, after, first


def _costs(early: _Rows, late: _Rows, per_block: int) -> FloatArray:
    """Sums of squares (N,) if the second pose holds from each instant on; infinite near the ends."""
    first, second = ((rows.residuals**2).sum(axis=1) for rows in (early, late))
    costs = np.concatenate([[0.0], np.cumsum(first)[:-1]]) + np.cumsum(second[::-1])[::-1]
    edge = _EDGE_BLOCKS * per_block
    costs[:edge] = costs[len(costs) - edge :] = np.inf
    return costs


def _joined(early: _Rows, late: _Rows, first: int) -> tuple[FloatArray, FloatArray]:
    """Return Jacobian (6 N + 35, 29) and residuals of first pose, shared unknowns, second pose; priors last."""
    N, unknowns = early.J.shape[0], early.J.shape[2]
    J = np.zeros((N, 6, unknowns + _POSE))
    J[:first, :, :unknowns] = early.J[:first]
    J[first:, :, _POSE:unknowns] = late.J[first:, :, _POSE:]
    J[first:, :, unknowns:] = late.J[first:, :, :_POSE]
    residuals = np.concatenate([early.residuals[:first], late.residuals[first:]])
    prior = np.zeros((unknowns + _POSE, unknowns + _POSE))
    prior[:unknowns, :unknowns] = early.prior_J
    # the second pose is near the first one
    prior[unknowns:, unknowns:] = np.diag(1 / _APART)
    prior_residuals = np.concatenate([early.prior_residuals, np.zeros(_POSE)])
    return np.vstack([J.reshape(6 * N, -1), prior]), np.concatenate([residuals.reshape(-1), prior_residuals])


def _compared(
    course: Course, before: Estimate, after: Estimate, first: int, per_block: int, params: CalibrationParams
) -> Slip | None:
    """Return the slip if two poses differ by more than chance and bending explain."""
    early, late = _Rows(course, before, params), _Rows(course, after, params)
    C = _covariance(*_joined(early, late, first), per_block)
    turn = Rotation.from_matrix(before.R.T @ after.R).as_rotvec()
    shift = after.p - before.p
    floor = np.array([np.deg2rad(params.slip_deg), params.slip_m]) / np.sqrt(_SIGNIFICANT)
    beyond = [
        d @ np.linalg.solve(C[part, part] + f**2 * np.eye(3), d) > _SIGNIFICANT
        for d, part, f in zip((turn, shift), (TURN, PLACE), floor, strict=True)
    ]
    if not any(beyond):
        return None
    costs = _costs(early, late, per_block)
    likely = np.flatnonzero(costs < costs.min() + _WORTH)
    return Slip(
        float(course.time[max(0, likely[0] - 1)]), float(course.time[likely[-1]]),
        float(np.linalg.norm(shift)), float(np.linalg.norm(turn)),
    )  # fmt: skip


def _covariance(J: FloatArray, residuals: FloatArray, per_block: int) -> FloatArray:
    """Covariance (6, 6) of the second pose less the first, for errors that depend on each other within blocks.

    The few blocks of a short part may agree by chance: what they would say if all errors were independent is added.
    """
    unknowns = J.shape[1]
    N = (len(residuals) - unknowns) // 6
    data = 6 * N
    scores = np.einsum("nik,ni->nk", J[:data].reshape(N, 6, unknowns), residuals[:data].reshape(N, 6))
    blocks = np.add.reduceat(scores, np.arange(0, N, per_block), axis=0)
    few = len(blocks) / max(1, len(blocks) - unknowns / 6)
    inverse = np.linalg.inv(J.T @ J)
    difference = inverse[-_POSE:] - inverse[:_POSE]
    return difference @ (few * blocks.T @ blocks + J[data:].T @ J[data:] + J.T @ J) @ difference.T
