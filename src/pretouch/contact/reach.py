"""How far a contact may move the arm: every point of the body's axes stays within a distance of where it began."""

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.robot.body import Capsules, placed
from pretouch.robot.kinematics import Kinematics, dot
from pretouch.types import BoolArray, FloatArray

BRAKES_S = 0.2
"""Time constant with which the speed away falls near the bound [s]: at 0.3 m/s from 0.06 m before it, by 1.5 m/s^2."""


def axis_ends(capsules: Capsules, kin: Kinematics) -> FloatArray:
    """Return where both ends of the axis of each of C capsules are in a posture, (C, 2, 3) [m]."""
    ends = np.stack([capsules.a, capsules.b], axis=1)
    turned = ends @ kin.rotation[capsules.link].swapaxes(-1, -2)
    return np.asarray(kin.position[capsules.link, None] + turned)


def within_reach(
    velocity: FloatArray, kin: Kinematics, moved_by: BoolArray, capsules: Capsules, origin: FloatArray,
    reach: float,
) -> tuple[FloatArray, float]:  # fmt: skip
    """Slow joint velocities that lead the arm too far from where it was.

    How far a point has come is convex along an axis, so no point of it has come farther than both its ends. All joints
    slow alike: none turns round, and so none turns towards who pushes. What leads no end farther away is left as it is.

    Args:
        velocity: (n,) joint velocities [rad/s].
        kin: posture.
        moved_by: (L, n) whether a joint moves a link.
        capsules: the body.
        origin: (C, 2, 3) where the ends of the axes were [m].
        reach: how far they may come [m].

    Returns the velocities, and how far the farthest end has come [m].
    """
    share, farthest = _share(kin, moved_by, capsules, velocity, origin, reach)
    return velocity if share >= 1.0 else velocity * share, farthest


@compiled
def _share(
    kin: Kinematics, moved_by: BoolArray, capsules: Capsules, qd: FloatArray, origin: FloatArray, reach: float
) -> tuple[float, float]:
    """Share of the joint velocities (n,) [rad/s] that is allowed, and how far the farthest end has come [m]."""
    anchor, axis = kin.anchor, kin.axis
    link, a, b, _ = placed(capsules, kin)
    share, farthest = 1.0, 0.0
    for e in range(2 * len(link)):
        c, end = divmod(e, 2)
        k = link[c]
        point = a[c] if end == 0 else b[c]
        away = point - origin[c, end]
        far = np.sqrt(dot(away, away))
        farthest = max(farthest, far)
        if far <= _LEAST_M:
            continue
        speed = 0.0
        for j in range(len(qd)):
            if moved_by[k, j]:
                speed += qd[j] * dot(_turned(axis[j], point - anchor[j]), away)
        speed /= far
        allowed = max(0.0, reach - far) / BRAKES_S
        if speed > allowed:
            share = min(share, allowed / speed)
    return share, farthest


@kernel
def _turned(axis: FloatArray, arm: FloatArray) -> FloatArray:
    """Velocity (3,) [m] per joint velocity of a point at `arm` (3,) [m] from a joint's axis."""
    return np.array([
        axis[1] * arm[2] - axis[2] * arm[1], axis[2] * arm[0] - axis[0] * arm[2], axis[0] * arm[1] - axis[1] * arm[0]
    ])  # fmt: skip


_LEAST_M = 1e-6
"""A point that has come no farther has no direction in which it went [m]."""
