"""Motion of each link, as an IMU at its origin, with its axes, would have measured it."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.signals import FINE_S, HALF_S, gaps, outside, smooth, times
from pretouch.calibration.values import LONGEST_GAP_S, RATE_HZ
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import kinematics_of
from pretouch.traces import JointTrace
from pretouch.types import BoolArray, FloatArray

_AROUND = np.arange(-2, 3)
"""Steps about an instant for its derivatives: differences of fourth order of the postures."""
_FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12 * FINE_S)
_SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / (12 * FINE_S**2)


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """Motion of one link at N instants, all in the link's own frame."""

    w: FloatArray
    """(N, 3) angular velocity [rad/s]."""
    a: FloatArray
    """(N, 3) acceleration of its origin [m/s^2]."""
    R_link_base: FloatArray
    """(N, 3, 3) turns vectors of a frame whose z points against gravity into the link's."""
    lever: FloatArray
    """(N, 3, 3) L = [alpha]x + [w]x [w]x, so that a point p of the link has the acceleration a + L p."""

    def at(self, which: BoolArray) -> "LinkMotion":
        """Return the motion at some of the instants."""
        return LinkMotion(self.w[which], self.a[which], self.R_link_base[which], self.lever[which])


class ArmMotion:
    """Motion of all links at common instants, from measured joint positions."""

    def __init__(self, model: RobotModel, joints: JointTrace) -> None:
        """Take joint positions at increasing instants. An interval that is short of what the filter needs has none."""
        self.model = model
        fine = times(joints.stamp[0], joints.stamp[-1])
        q = smooth(joints.stamp, joints.q, fine)
        chosen = np.arange(0, len(fine), round(1 / (RATE_HZ * FINE_S)))
        self.time: FloatArray = fine[chosen]
        """(N,) instants [s]."""
        self.usable: BoolArray = outside(self.time, gaps(joints.stamp, LONGEST_GAP_S), HALF_S + 0.01)
        """(N,) whether joint positions were measured all around."""
        self.q: FloatArray = q[chosen]
        """(N, n) joint positions [rad]."""
        around = np.clip(chosen[:, None] + _AROUND, 0, len(fine) - 1)
        kin = kinematics_of(model, q[around.ravel()])
        self._position, self._rotation = (x.reshape(*around.shape, *x.shape[1:]) for x in (kin.position, kin.rotation))
        self._links: dict[int, LinkMotion] = {}

    def link(self, index: int) -> LinkMotion:
        """Return the motion of a link."""
        if index not in self._links:
            p, R = self._position[:, :, index], self._rotation[:, :, index]
            R_link_base = R[:, 2].swapaxes(1, 2)
            # R^T R' is [w]x, and R^T R'' the lever
            turn = R_link_base @ np.einsum("k,nkij->nij", _FIRST, R)
            w = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
            a = np.einsum("nij,k,nkj->ni", R_link_base, _SECOND, p)
            lever = R_link_base @ np.einsum("k,nkij->nij", _SECOND, R)
            self._links[index] = LinkMotion(w, a, R_link_base @ self.model.mechanism.upright.T, lever)
        return self._links[index]
