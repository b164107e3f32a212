"""The pose of one unit on a given link: fits in rounds, until clock and outliers are settled."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.fit import CLOCK, Estimate, Fit, fit, start
from pretouch.calibration.link_motion import ArmMotion, LinkMotion
from pretouch.calibration.signals import ImuSignal, Measured
from pretouch.calibration.values import SHORTEST_S, TOLERATED_ACCELERATION, TOLERATED_ANGULAR_VELOCITY
from pretouch.types import BoolArray, FloatArray

_OUTLIER_FACTOR = 6.0
"""Beyond this many times the median difference, and what is tolerated, an instant is left out."""
_ROUNDS = 4
_SETTLED_S = 1e-4


@dataclass(frozen=True, eq=False)
class Located:
    """Pose of a unit on the assumption that it sits on a link."""

    link: int
    """Index of the link."""
    estimate: Estimate
    covariance: FloatArray
    """(6, 6) of rotation vector in the sensor frame [rad] and position in the link frame [m]."""
    noise: FloatArray
    """(6,) root mean square of what is not explained, each sensor's the same for its axes [rad/s, m/s^2]."""
    late: float
    """Lag of the unit's clock [s]."""
    instants: BoolArray
    """(N,) mask of the arm's instants at which both sides were measured."""
    used: BoolArray
    """(N,) mask of those at which the model explains the measurements."""

    @property
    def pose(self) -> FloatArray:
        """T_link_sensor (4, 4)."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.estimate.R, self.estimate.p
        return T


def known_instants(arm: ArmMotion, signal: ImuSignal, late: float) -> BoolArray:
    """Mask of the arm's instants (N,) at which both sides were measured, for a lag of the unit's clock [s]."""
    return arm.usable & signal.usable(arm.time + late)


def enough(arm: ArmMotion, which: BoolArray) -> bool:
    """Return True if instants (N,) are enough for an estimate."""
    return bool(which.sum() * (arm.time[1] - arm.time[0]) >= SHORTEST_S)


def locate(arm: ArmMotion, signal: ImuSignal, link: int, late: float) -> Located | None:
    """Locate a unit on a link, from an estimate of its clock's lag [s]; None if too little was measured."""
    motion = arm.link(link)
    noise = np.repeat((TOLERATED_ANGULAR_VELOCITY, TOLERATED_ACCELERATION), 3) / 10
    estimate: Estimate | None = None
    for _ in range(_ROUNDS):
        instants = known_instants(arm, signal, late)
        if not enough(arm, instants):
            return None
        here, measured = motion.at(instants), signal.at(arm.time[instants] + late)
        solution = fit(here, measured, estimate or start(here, measured), noise, robust=True)
        estimate, assumed = solution.estimate, late
        late += estimate.errors[CLOCK]
        if abs(estimate.errors[CLOCK]) < _SETTLED_S:
            break
    inliers = explained(solution.estimate, here, measured)
    used = instants.copy()
    used[instants] = inliers
    if not enough(arm, used):
        inliers, used = np.ones_like(inliers), instants
    here, measured = here.at(inliers), Measured(measured.values[inliers], measured.rates[inliers])
    solution, noise = _final(solution, here, measured, noise)
    C, late = 0.5 * (solution.covariance + solution.covariance.T), assumed + float(solution.estimate.errors[CLOCK])
    return Located(link, solution.estimate, C[:6, :6], noise, late, instants, used)


def explained(estimate: Estimate, motion: LinkMotion, measured: Measured) -> BoolArray:
    """Mask of the instants (N,) at which the model is near the measurements of both sensors."""
    size = np.linalg.norm(estimate.differences(motion, measured).reshape(-1, 2, 3), axis=2)
    tolerated = np.array([TOLERATED_ANGULAR_VELOCITY, TOLERATED_ACCELERATION])
    return np.all(size <= np.maximum(tolerated, _OUTLIER_FACTOR * np.median(size, axis=0)), axis=1)


def _final(solution: Fit, motion: LinkMotion, measured: Measured, noise: FloatArray) -> tuple[Fit, FloatArray]:
    """Fit without robustness, weighted by the residuals of each sensor (6,)."""
    for _ in range(2):
        solution = fit(motion, measured, solution.estimate, noise)
        noise = np.repeat(np.sqrt((solution.noise.reshape(2, 3) ** 2).mean(axis=1)), 3)
    return solution, noise
