"""What a commander asks of the arm: a twist, joint velocities, a pose or joint positions, now or over a horizon."""

from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from pretouch.errors import ParameterError
from pretouch.values import FloatArray, real, value


class DesiredKind(IntEnum):
    """What the numbers are."""

    TWIST = 0
    """(6,) velocity of the end-effector origin [m/s] and angular velocity [rad/s], base frame."""
    JOINT_VELOCITIES = 1
    """(n,) [rad/s]."""
    POSE = 2
    """(12,) position of the end-effector origin [m] and R_O_ee row by row, base frame."""
    JOINT_POSITIONS = 3
    """(n,) [rad]."""


@value
class Desired:
    """A desired motion of M instants; made by `twist`, `joint_velocities`, `pose` or `joint_positions`.

    At each step counts what is asked for that instant: between positions it is interpolated, and their difference is
    the speed; a velocity holds until the next. After the last instant it counts for `failure.desired_timeout_s`.
    """

    kind: DesiredKind
    stamp: FloatArray
    """(M,) instants, increasing, by the clock of the steps [s]."""
    number: FloatArray
    """(M, w) what is asked, see `DesiredKind`."""
    refused: str = ""
    """Why what was asked is none, found where it came in: the arm holds, and says this."""


_MOST = 1000
"""Instants of a horizon."""
LARGEST = 1e3
"""A desired number, a joint position or velocity [rad, rad/s, m, m/s] from here on is none: another unit, or broken."""
_ROUNDING = 1e-6
"""By how much the columns of a rotation may miss unit length and right angles."""
LATEST = 1e12
"""A time stamp [s] from here on is none, whatever the clock began with."""
_AHEAD_S = 60.0
"""A horizon that begins so far in the future is stamped by another clock."""
_WIDTH = {DesiredKind.TWIST: 6, DesiredKind.POSE: 12}


def twist(stamp: ArrayLike, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> Desired:
    """Ask for a velocity of the end-effector origin (3,) [m/s] and an angular velocity (3,) [rad/s], base frame.

    With M stamps, rows (M, 3) each. A profile that leaves the orientation free takes no angular velocity, and no
    profile more than `task.orientation_gain_1_s` [rad/s].
    """
    v, w = np.atleast_2d(real(linear)), np.atleast_2d(real(angular))
    return _made(DesiredKind.TWIST, stamp, np.hstack([v, np.broadcast_to(w, v.shape)]))


def joint_velocities(stamp: ArrayLike, qd: ArrayLike) -> Desired:
    """Ask for joint velocities (n,) [rad/s], or (M, n) with M stamps."""
    return _made(DesiredKind.JOINT_VELOCITIES, stamp, np.atleast_2d(real(qd)))


def pose(stamp: ArrayLike, T_O_ee: ArrayLike) -> Desired:
    """Ask for a pose T_O_ee (4, 4) of the end-effector in the base frame, or (M, 4, 4) with M stamps."""
    T = real(T_O_ee).reshape(-1, 4, 4)
    return _made(DesiredKind.POSE, stamp, np.hstack([T[:, :3, 3], T[:, :3, :3].reshape(-1, 9)]))


def joint_positions(stamp: ArrayLike, q: ArrayLike) -> Desired:
    """Ask for joint positions (n,) [rad], or (M, n) with M stamps."""
    return _made(DesiredKind.JOINT_POSITIONS, stamp, np.atleast_2d(real(q)))


def refused(stamp: float, reason: str) -> Desired:
    """Ask for nothing, for a reason that a person reads: what came in at an instant [s] could not be used."""
    return Desired(DesiredKind.TWIST, np.array([stamp]), np.zeros((1, 6)), reason)


def _made(kind: DesiredKind, stamp: ArrayLike, number: FloatArray) -> Desired:
    stamps = np.atleast_1d(real(stamp))
    if stamps.shape != number.shape[:1]:
        raise ParameterError(f"A desired motion has {stamps.size} stamps and {len(number)} rows: give one stamp a row.")
    return Desired(kind, stamps, number)


def sound_desired(desired: Desired | None, joints: int, now: float) -> tuple[Desired | None, str]:
    """Copy a desired motion for an arm of so many joints, or say what keeps it from being one."""
    if desired is None:
        return None, ""
    try:
        kind = DesiredKind(desired.kind)
        stamp, number = real(desired.stamp), real(desired.number)
        if desired.refused:
            return None, str(desired.refused)
    except (AttributeError, TypeError, ValueError, OverflowError):
        return None, f"it is a {type(desired).__name__} that holds no kind, stamps and numbers"
    wanted = _WIDTH.get(kind, joints)
    if stamp.ndim != 1 or not 1 <= len(stamp) <= _MOST or number.shape != (len(stamp), wanted):
        return None, f"stamps {stamp.shape} and numbers {number.shape}, not (M,) and (M, {wanted}) with M up to {_MOST}"
    wrong = ~(np.abs(number) < LARGEST)
    if wrong.any():
        return None, f"it asks for {number[wrong][0]:g}"
    wrong = ~(np.abs(stamp) < LATEST)
    if wrong.any():
        return None, f"its time stamp is {stamp[wrong][0]:g}"
    if (np.diff(stamp) <= 0.0).any():
        return None, "its stamps do not increase"
    if stamp[0] > now + _AHEAD_S:
        return None, f"it is stamped {stamp[0] - now:.0f} s in the future"
    if kind is DesiredKind.POSE and not _are_rotations(number[:, 3:].reshape(-1, 3, 3)):
        return None, "its orientation is no rotation"
    return Desired(kind, stamp, number), ""


def _are_rotations(R: FloatArray) -> bool:
    orthonormal = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)) < _ROUNDING
    return bool(orthonormal.all() and (np.linalg.det(R) > 0.0).all())
