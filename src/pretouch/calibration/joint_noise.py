"""Effect of joint position noise on an estimated place.

Accelerations of the joints, differentiated from noisy positions, look like motion of their own. They shrink the levers
that a fit finds, in all directions in which the true motion is weak, and the residuals do not show it. By how much is
known: with noise n of a joint's acceleration about the axis c through o, a point p accelerates by n c x (p - o), and
the model says that its derivative by p is n [c]x. Their product is the pull on p.
"""

import numpy as np

from pretouch.calibration.fit import PLACE, POSE_PRIOR
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located
from pretouch.calibration.signals import FINE_S, smooth, times
from pretouch.calibration.values import CUTOFF_HZ
from pretouch.robot.postures import kinematics_of
from pretouch.traces import JointTrace, on_grid
from pretouch.types import FloatArray

_EVERY = 10
"""Step between the arm's instants that are used."""
_ASIDE = 1 / 3
"""Variance of the pull in every direction, as a share of its square: of errors that noise makes, those across the
expected one are smaller, but count for more where the motion is strong."""


class JointNoise:
    """Noise of measured joint positions, taken as white."""

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
