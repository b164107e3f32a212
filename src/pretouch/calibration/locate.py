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
    known: BoolArray
    """(N,) at which of the arm's instants both sides were measured."""
    used: BoolArray
    """(N,) at which of them the model explains what was measured."""

    @property
    def pose(self) -> FloatArray:
        """T_link_sensor (4, 4)."""
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = self.estimate.R, self.estimate.p
        return T


def known_instants(arm: ArmMotion, signal: ImuSignal, late: float) -> BoolArray:
    """Tell at which of the arm's instants (N,) both sides were measured, if the unit's clock is late by so much [s]."""
    return arm.usable & signal.usable(arm.time + late)


def enough(arm: ArmMotion, which: BoolArray) -> bool:
    """Tell whether instants (N,) are enough to find anything from."""
    return bool(which.sum() * (arm.time[1] - arm.time[0]) >= SHORTEST_S)


def locate(arm: ArmMotion, signal: ImuSignal, link: int, late: float) -> Located | None:
    """Find where on a link a unit sits whose clock is late by about so much [s]; None if too little was measured."""
    motion = arm.link(link)
    noise = np.repeat((TOLERATED_ANGULAR_VELOCITY, TOLERATED_ACCELERATION), 3) / 10
    estimate: Estimate | None = None
    for _ in range(_ROUNDS):
        known = known_instants(arm, signal, late)
        if not enough(arm, known):
            return None
        here, measured = motion.at(known), signal.at(arm.time[known] + late)
        found = fit(here, measured, estimate or start(here, measured), noise, robust=True)
        estimate, assumed = found.estimate, late
        late += estimate.errors[CLOCK]
        if abs(estimate.errors[CLOCK]) < _SETTLED_S:
            break
    inliers = explained(found.estimate, here, measured)
    used = known.copy()
    used[known] = inliers
    if not enough(arm, used):
        inliers, used = np.ones_like(inliers), known
    here, measured = here.at(inliers), Measured(measured.values[inliers], measured.rates[inliers])
    found, noise = _final(found, here, measured, noise)
    C, late = 0.5 * (found.covariance + found.covariance.T), assumed + float(found.estimate.errors[CLOCK])
    return Located(link, found.estimate, C[:6, :6], noise, late, known, used)


def explained(estimate: Estimate, motion: LinkMotion, measured: Measured) -> BoolArray:
    """Tell at which instants (N,) the model is near what both sensors measured."""
    size = np.linalg.norm(estimate.differences(motion, measured).reshape(-1, 2, 3), axis=2)
    tolerated = np.array([TOLERATED_ANGULAR_VELOCITY, TOLERATED_ACCELERATION])
    return np.all(size <= np.maximum(tolerated, _OUTLIER_FACTOR * np.median(size, axis=0)), axis=1)


def _final(found: Fit, motion: LinkMotion, measured: Measured, noise: FloatArray) -> tuple[Fit, FloatArray]:
    """Fit without robustness, weighted by what each sensor leaves unexplained (6,)."""
    for _ in range(2):
        found = fit(motion, measured, found.estimate, noise)
        noise = np.repeat(np.sqrt((found.noise.reshape(2, 3) ** 2).mean(axis=1)), 3)
    return found, noise
