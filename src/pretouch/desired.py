"""Desired motion, from a commander: a twist, joint velocities, a pose or joint positions, now or over a horizon."""

from enum import IntEnum
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from pretouch.errors import ParameterError
from pretouch.values import LARGEST, LATEST, FloatArray, real, value


class DesiredKind(IntEnum):
    """Quantity that a desired motion gives."""

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
    """A desired motion of M instants, from `twist`, `joint_velocities`, `pose` or `joint_positions`.

    Each step takes the value for its own instant: positions are interpolated, and their difference is the speed; a
    velocity holds until the next one. The last value is valid for `failure.desired_timeout_s`.
    """

    kind: DesiredKind
    stamp: Annotated[FloatArray, "M", LATEST]
    """(M,) instants, increasing, by the clock of the steps [s]."""
    number: Annotated[FloatArray, "M", "w", LARGEST]
    """(M, w) desired values, see `DesiredKind`."""
    refused: str = ""
    """Reason why the request could not be read, '' if it could: the arm holds and shows this."""


def twist(stamp: ArrayLike, linear: ArrayLike, angular: ArrayLike = (0.0, 0.0, 0.0)) -> Desired:
    """Ask for a velocity of the end-effector origin (3,) [m/s] and an angular velocity (3,) [rad/s], base frame.

    With M stamps, rows (M, 3) each. A profile that leaves the orientation free takes no angular velocity, and no
    profile more than `task.orientation_gain_1_s` [rad/s].
    """
    v, w = np.atleast_2d(real(linear)), np.atleast_2d(real(angular))
    return _desired(DesiredKind.TWIST, stamp, np.hstack([v, np.broadcast_to(w, v.shape)]))


def joint_velocities(stamp: ArrayLike, qd: ArrayLike) -> Desired:
    """Ask for joint velocities (n,) [rad/s], or (M, n) with M stamps."""
    return _desired(DesiredKind.JOINT_VELOCITIES, stamp, np.atleast_2d(real(qd)))


def pose(stamp: ArrayLike, T_O_ee: ArrayLike) -> Desired:
    """Ask for a pose T_O_ee (4, 4) of the end-effector in the base frame, or (M, 4, 4) with M stamps."""
    T = real(T_O_ee).reshape(-1, 4, 4)
    return _desired(DesiredKind.POSE, stamp, np.hstack([T[:, :3, 3], T[:, :3, :3].reshape(-1, 9)]))


def joint_positions(stamp: ArrayLike, q: ArrayLike) -> Desired:
    """Ask for joint positions (n,) [rad], or (M, n) with M stamps."""
    return _desired(DesiredKind.JOINT_POSITIONS, stamp, np.atleast_2d(real(q)))


def refused(stamp: float, reason: str) -> Desired:
    """Return a motion in place of a request of an instant [s] that could not be used; a person reads the reason."""
    return Desired(DesiredKind.TWIST, np.array([stamp]), np.zeros((1, 6)), reason)


def _desired(kind: DesiredKind, stamp: ArrayLike, number: FloatArray) -> Desired:
    stamps = np.atleast_1d(real(stamp))
    if stamps.shape != number.shape[:1]:
        raise ParameterError(f"A desired motion has {stamps.size} stamps and {len(number)} rows: give one stamp a row.")
    return Desired(kind, stamps, number)
