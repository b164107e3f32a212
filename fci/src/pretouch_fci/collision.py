"""The robot's own reaction to external forces and to itself: thresholds, contacts, collisions.

Pure but for its own memory.
"""

from typing import NamedTuple, Self

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.robot.postures import capsule_ends, kinematics_of, self_distances
from pretouch.types import BoolArray, FloatArray
from pretouch_fci.wire import JOINTS

_LOOKS_EVERY = 10
"""In so many milliseconds the arm looks once whether it comes into itself."""
_CLOSES_M = 1e-5
"""Two parts that overlap come closer if their distance shrinks by more in that time [m]."""
_MOVING = 1e-3
"""Commanded acceleration from which the thresholds for accelerations hold [rad/s^2]."""


class CollisionThresholds(NamedTuple):
    """Thresholds of a contact and of a collision.

    The first axis tells whether the robot changes its speed or goes steadily; the second has the lower threshold, of a
    contact, and the upper one, of a collision.
    """

    torque: FloatArray
    """(2, 2, 7) [Nm]"""
    force: FloatArray
    """(2, 2, 6) [N, Nm]"""

    @classmethod
    def of(cls, values: FloatArray) -> Self | None:
        """Read the body (52,) of the request that sets it; None if a number in it is no threshold."""
        if not np.all(np.isfinite(values)) or np.any(values < 0):
            return None
        return cls(values[: 4 * JOINTS].reshape(2, 2, JOINTS), values[4 * JOINTS :].reshape(2, 2, 6))


DEFAULT_BEHAVIOR = CollisionThresholds(np.full((2, 2, JOINTS), 20.0), np.full((2, 2, 6), 20.0))
"""Before any is set: that of the vendor's examples."""


class Contacts:
    """Joints and directions in contact, and those in collision; the latter until they are reset."""

    def __init__(self) -> None:
        self.behavior = DEFAULT_BEHAVIOR
        self.joint_contact, self.cartesian_contact = np.zeros(JOINTS, np.bool_), np.zeros(6, np.bool_)
        self.joint_collision, self.cartesian_collision = self.joint_contact, self.cartesian_contact

    def update(self, torques: FloatArray, wrench: FloatArray, qdd: FloatArray) -> tuple[str, ...]:
        """Take external torques (7,) [Nm] and the wrench (6,) [N, Nm]; return the reflexes they cause.

        `qdd` (7,) are the commanded accelerations [rad/s^2].
        """
        steady = int(not np.any(np.abs(qdd) > _MOVING))
        self.joint_contact, joint = np.abs(torques) > self.behavior.torque[steady]
        self.cartesian_contact, cartesian = np.abs(wrench) > self.behavior.force[steady]
        self.joint_collision, self.cartesian_collision = (
            self.joint_collision | joint,
            self.cartesian_collision | cartesian,
        )
        return _names(cartesian, "cartesian_reflex") + _names(joint, "joint_reflex")

    def forget(self) -> None:
        """Forget collisions."""
        self.joint_collision, self.cartesian_collision = np.zeros(JOINTS, np.bool_), np.zeros(6, np.bool_)


class SelfCollision:
    """Check for self-collision of an arm. Parts that overlap where a motion begins may separate."""

    def __init__(self, model: RobotModel) -> None:
        self._model, self._count = model, 0
        self._before: FloatArray | None = None

    def forget(self) -> None:
        """Begin anew, as for another motion."""
        self._before, self._count = None, 0

    def update(self, q: FloatArray) -> tuple[str, ...]:
        """Take the positions q (7,) [rad] of another millisecond; return the error that they are."""
        self._count += 1
        if self._count % _LOOKS_EVERY:
            return ()
        model = self._model
        distances = self_distances(model, capsule_ends(model, kinematics_of(model, q[None])))[0]
        before, self._before = distances if self._before is None else self._before, distances
        return _names((distances < 0) & (distances < before - _CLOSES_M), "self_collision_avoidance_violation")


def _names(crossed: BoolArray, name: str) -> tuple[str, ...]:
    return (name,) if np.any(crossed) else ()
