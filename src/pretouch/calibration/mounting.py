"""How a unit sits on the surface of its link, as far as capsules tell."""

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sensing.unit import seat
from pretouch.types import FloatArray

DEEPEST = 0.02
"""A unit that is found further inside a capsule [m] cannot be there: capsules are no further off the true surface."""
_CLEAR = 1e-4
"""Height at which a unit that was moved out of a capsule is left [m]."""
_TRIES = 20
_INSIDE, _FACING = 3.0, 0.02
"""Where links are weighed: how much worse being inside is than being off by as much, and how far off a beam along the
surface is worth [m]."""


def likely_member(model: RobotModel, body: tuple[int, ...], link: int, T: FloatArray) -> int:
    """Return the link, of those fixed to each other, on whose surface a unit most likely sits.

    Nearest to it, and looked away from. Links without a capsule are chosen only if none has one.

    Args:
        model: the arm.
        body: indices of the links.
        link: one of them.
        T: (4, 4) pose of the unit on that link.
    """

    def oddity(member: int) -> float:
        """In metres."""
        there, _ = seen_from(model, member, link, T, np.eye(6))
        found = seat(model, member, there[:3, 3])
        if found is None:
            return np.inf
        away = found.height if found.height > 0 else -_INSIDE * found.height
        return away + _FACING * (1 - float(found.normal @ there[:3, 2]))

    best = min(body, key=oddity)
    return best if np.isfinite(oddity(best)) else link


def seen_from(model: RobotModel, link: int, other: int, T: FloatArray, C: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return pose (4, 4) and covariance (6, 6) in the frame of `link`, given in that of `other`, to which it is fixed.

    The covariance is of rotation vector in the sensor frame [rad] and position in the link frame [m].
    """
    kin = model.kinematics(model.q_mid)
    R = kin.rotation[link].T @ kin.rotation[other]
    T_link_other = np.eye(4)
    T_link_other[:3, :3] = R
    T_link_other[:3, 3] = kin.rotation[link].T @ (kin.position[other] - kin.position[link])
    turned = np.eye(6)
    turned[3:, 3:] = R
    return T_link_other @ T, turned @ C @ turned.T


def moved_out(model: RobotModel, link: int, p: FloatArray) -> FloatArray | None:
    """Return the point (3,) outside all capsules of a link that p (3,) is moved to; None if there is none near by."""
    at = p
    for _ in range(_TRIES):
        below = seat(model, link, at)
        if below is None or below.height >= 0:
            return at if np.linalg.norm(at - p) <= 2 * DEEPEST else None
        at = at + (_CLEAR - below.height) * below.normal
    return None
