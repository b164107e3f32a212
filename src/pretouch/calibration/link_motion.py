"""How each link moved: what an IMU at its origin, with its axes, would have measured."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pretouch.calibration.signals import HALF_S, gaps, outside, rate_of_change, smooth, times
from pretouch.calibration.values import LONGEST_GAP_S, RATE_HZ
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import kinematics_of
from pretouch.traces import JointTrace
from pretouch.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class LinkMotion:
    """Motion of one link at N instants, all in the link's own frame."""

    w: FloatArray
    """(N, 3) angular velocity [rad/s]."""
    a: FloatArray
    """(N, 3) acceleration of its origin [m/s^2]."""
    R_link_base: FloatArray
    """(N, 3, 3) turns vectors of the base frame, such as gravity, into the link's."""
    alpha: FloatArray
    """(N, 3) angular acceleration [rad/s^2]."""

    @cached_property
    def lever(self) -> FloatArray:
        """(N, 3, 3) L, so that a point p of the link has the acceleration a + L p."""
        return skew(self.alpha) + skew(self.w) @ skew(self.w)

    def at(self, which: BoolArray) -> "LinkMotion":
        """Return the motion at some of the instants."""
        return LinkMotion(self.w[which], self.a[which], self.R_link_base[which], self.alpha[which])


def skew(v: FloatArray) -> FloatArray:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3) from the left."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(*v.shape[:-1], 3, 3)


class ArmMotion:
    """Motion of all links at common instants, from measured joint positions."""

    def __init__(self, model: RobotModel, joints: JointTrace) -> None:
        """Take joint positions at increasing instants. An interval that is short of what the filter needs has none."""
        self.model = model
        fine = times(joints.stamp[0], joints.stamp[-1])
        q = smooth(joints.stamp, joints.q, fine)
        qd = rate_of_change(q)
        chosen = slice(None, None, max(1, round(1 / (RATE_HZ * (fine[1] - fine[0])))))
        self.time: FloatArray = fine[chosen]
        """(N,) instants [s]."""
        self.usable: BoolArray = outside(self.time, gaps(joints.stamp, LONGEST_GAP_S), HALF_S + 0.01)
        """(N,) whether joint positions were measured all around."""
        self.q: FloatArray = q[chosen]
        """(N, n) joint positions [rad]."""
        self.qd: FloatArray = qd[chosen]
        """(N, n) joint velocities [rad/s]."""
        self._qdd = rate_of_change(qd)[chosen]
        self._position, self._rotation, anchor, axis = kinematics_of(model, self.q)
        self._chain = chain_motion(anchor, axis, self.qd, self._qdd)
        """Of what moves with the first 0, 1, ... n joints: what `chain_motion` returns, (N, n + 1, 3) each."""
        self._links: dict[int, LinkMotion] = {}

    def link(self, index: int) -> LinkMotion:
        """Return the motion of a link."""
        if index not in self._links:
            joints = int(self.model.moved_by[index].sum())
            w, alpha, a, point = (part[:, joints] for part in self._chain)
            arm = self._position[:, index] - point
            a = a + lever_acceleration(w, alpha, arm)
            R = self._rotation[:, index].swapaxes(1, 2)
            w, a, alpha = (np.einsum("nij,nj->ni", R, v) for v in (w, a, alpha))
            self._links[index] = LinkMotion(w, a, R, alpha)
        return self._links[index]


def chain_motion(
    anchor: FloatArray, axis: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Motion, base frame, of what moves with the first 0, 1, ... n joints, at each of N instants: (N, n + 1, 3) each.

    Angular velocity [rad/s], angular acceleration [rad/s^2], acceleration of a point [m/s^2], and that point [m]. The
    first two arguments (N, n, 3) are those of `Kinematics`; joint velocities [rad/s] and accelerations [rad/s^2] are
    (N, n).
    """
    w, alpha, a, point = np.zeros((4, len(qd), qd.shape[1] + 1, 3))
    for j in range(qd.shape[1]):
        a[:, j + 1] = a[:, j] + lever_acceleration(w[:, j], alpha[:, j], anchor[:, j] - point[:, j])
        point[:, j + 1] = anchor[:, j]
        turn = axis[:, j] * qd[:, j, None]
        alpha[:, j + 1] = alpha[:, j] + np.cross(w[:, j], turn) + axis[:, j] * qdd[:, j, None]
        w[:, j + 1] = w[:, j] + turn
    return w, alpha, a, point


def lever_acceleration(w: FloatArray, alpha: FloatArray, r: FloatArray) -> FloatArray:
    """Acceleration (..., 3) [m/s^2] of one point of a body relative to another that is r (..., 3) [m] before it.

    `w` (..., 3) is the body's angular velocity [rad/s], `alpha` (..., 3) its angular acceleration [rad/s^2].
    """
    return np.asarray(np.cross(alpha, r) + np.cross(w, np.cross(w, r)))
