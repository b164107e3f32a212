"""Kinds of motion: which field of a command counts, and which joint velocities it asks for. A kind is one motion's."""

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from pretouch.serving.fci.limits import PERIOD_S, MotionLimits
from pretouch.serving.fci.wire import Generator
from pretouch.types import FloatArray


class Asked(NamedTuple):
    """What a command comes to."""

    qd: FloatArray
    """(7,) joint velocities for the next millisecond [rad/s]."""
    errors: tuple[str, ...] = ()
    """Why it cannot be followed, whatever the joints' limits say."""


class MotionKind(Protocol):
    """One kind of motion."""

    generator: Generator
    field: str
    """Of a command, the one that counts."""
    not_a_number: str
    """The error of a command that is not finite."""

    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> Asked:
        """Return what finite values of the field ask for.

        Args:
            values: of the field.
            q: (7,) commanded positions so far [rad].
            first: whether no command has come before.
        """
        ...


class JointVelocity:
    """Velocities (7,) [rad/s]."""

    generator, field = Generator.JOINT_VELOCITY, "dq_c"
    not_a_number = "joint_motion_generator_velocity_limits_violation"

    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> Asked:
        """Take them as they are."""
        return Asked(values)


class JointPosition:
    """Positions (7,) [rad], differentiated backwards as the vendor's documents say."""

    generator, field = Generator.JOINT_POSITION, "q_c"
    not_a_number = "joint_motion_generator_position_limits_violation"

    def __init__(self, limits: MotionLimits) -> None:
        # The vendor does not say how far the first may be from where the arm is. The acceleration limit would catch
        # what is farther than this; by its name this error says better what is wrong, and on the robot it comes alone.
        self._start_within = limits.qdd * PERIOD_S**2  # [rad]

    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> Asked:
        """Go there within the millisecond; the first must be where the arm is commanded to be already."""
        with np.errstate(over="ignore"):
            qd = (values - q) / PERIOD_S
        if first and np.any(np.abs(values - q) > self._start_within):
            return Asked(qd, ("joint_position_motion_generator_start_pose_invalid",))
        return Asked(qd)


KINDS: dict[Generator, Callable[[MotionLimits], MotionKind]] = {
    Generator.JOINT_POSITION: JointPosition,
    Generator.JOINT_VELOCITY: lambda _limits: JointVelocity(),
}
"""Those that are served."""
