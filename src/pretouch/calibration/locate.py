"""The pose of one unit on a given link: fits in rounds, until clock and outliers are settled; noise of the joints."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.fit import CLOCK, PLACE, POSE_PRIOR, Estimate, fit, start
from pretouch.calibration.link_motion import ArmMotion, LinkMotion
from pretouch.calibration.signals import FINE_S, ImuSignal, Measured, smooth, times
from pretouch.calibration.values import CUTOFF_HZ, SHORTEST_S, TOLERATED_ACCELERATION, TOLERATED_ANGULAR_VELOCITY
from pretouch.robot.postures import kinematics_of
from pretouch.traces import JointTrace, on_grid
from pretouch.types import BoolArray, FloatArray

_OUTLIER_FACTOR = 6.0
"""Beyond this many times the median difference, and what is tolerated, an instant is left out."""
_EVERY = 10
"""Step between the arm's instants at which the noise of the joints is looked at."""
_ASIDE = 1 / 3
"""Variance of the pull in every direction, as a share of its square: of errors that noise makes, those across the
expected one are smaller, but count for more where the motion is strong."""
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
    for _ in range(2):  # without robustness, weighted by the residuals of each sensor
        solution = fit(here, measured, solution.estimate, noise)
        noise = np.repeat(np.sqrt((solution.noise.reshape(2, 3) ** 2).mean(axis=1)), 3)
    C, late = 0.5 * (solution.covariance + solution.covariance.T), assumed + float(solution.estimate.errors[CLOCK])
    return Located(link, solution.estimate, C[:6, :6], noise, late, instants, used)


def explained(estimate: Estimate, motion: LinkMotion, measured: Measured) -> BoolArray:
    """Mask of the instants (N,) at which the model is near the measurements of both sensors."""
    size = np.linalg.norm(estimate.differences(motion, measured).reshape(-1, 2, 3), axis=2)
    tolerated = np.array([TOLERATED_ANGULAR_VELOCITY, TOLERATED_ACCELERATION])
    return np.all(size <= np.maximum(tolerated, _OUTLIER_FACTOR * np.median(size, axis=0)), axis=1)


class JointNoise:
    """Noise of measured joint positions, taken as white, and its effect on an estimated place.

    Accelerations of the joints, differentiated from noisy positions, look like motion of their own. They shrink the
    levers that a fit finds, in all directions in which the true motion is weak, and the residuals do not show it. By
    how much is known: with noise n of a joint's acceleration about the axis c through o, a point p accelerates by
    n c x (p - o), and the model says that its derivative by p is n [c]x. Their product is the pull on p.
    """

    def __init__(self, arm: ArmMotion, joints: JointTrace) -> None:
        fine = times(joints.stamp[0], joints.stamp[-1])
        rest = joints.q - on_grid(joints.stamp, fine[0], FINE_S, smooth(joints.stamp, joints.q, fine))
        rate = 1 / float(np.median(np.diff(joints.stamp)))
        passed = min(1.0, 2 * CUTOFF_HZ / rate)
        # of normal noise, half the values are within 0.6745 standard deviations
        variance = (np.median(np.abs(rest), axis=0) / 0.6745) ** 2 / max(1 - passed, 0.1)
        density = 2 * variance / rate
        self.acceleration: FloatArray = np.sqrt(density * (2 * np.pi) ** 4 * CUTOFF_HZ**5 / 5)
        """(n,) standard deviation of the joints' accelerations after the low-pass [rad/s^2]."""
        self._model = arm.model
        self._position, self._rotation, self._anchor, self._axis = kinematics_of(arm.model, arm.q[::_EVERY])

    def covariance(self, located: Located) -> FloatArray:
        """Covariance (6, 6) of a place, with the error that noise of the joints makes added to it.

        Of rotation vector in the sensor frame [rad] and position in the link frame [m].
        """
        R, origin = self._rotation[:, located.link], self._position[:, located.link]
        pull = np.zeros(3)
        for j in np.flatnonzero(self._model.moved_by[located.link]):
            axis = np.einsum("nji,nj->ni", R, self._axis[:, j])
            lever = located.estimate.p - np.einsum("nji,nj->ni", R, self._anchor[:, j] - origin)
            accelerated = np.cross(axis, lever)
            pull += self.acceleration[j] ** 2 * np.cross(accelerated, axis).mean(axis=0)
        information = located.used.sum() / located.noise[3] ** 2
        moved = information * located.covariance[:, PLACE]
        C = located.covariance + moved @ (np.outer(pull, pull) + pull @ pull * _ASIDE * np.eye(3)) @ moved.T
        # what a motion does not tell is no less certain than before it
        C = C - C @ np.linalg.solve(C + np.diag(POSE_PRIOR**2), C)
        return (C + C.T) / 2
