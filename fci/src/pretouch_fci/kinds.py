"""Kinds of motion: which fields of a command count, and which joint velocities they ask for. A kind is one motion's."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from pretouch.types import FloatArray
from pretouch_fci.limits import PERIOD_S, MotionLimits
from pretouch_fci.wire import Generator

START_M, START_RAD = 1e-3, 1e-3
"""How far from where the arm measurably is a motion may begin there [m, rad]: our choice. The arm's state is
milliseconds old when the command comes, and the arm may still swing."""


class JointStep(NamedTuple):
    """Joint motion that a command results in."""

    qd: FloatArray
    """(7,) joint velocities for the next millisecond [rad/s]."""
    errors: tuple[str, ...] = ()
    """Reasons why it cannot be followed, apart from the joints' limits."""


class MotionKind(ABC):
    """One kind of motion. Where nothing else is said, it is one of the joints that begins anywhere."""

    generator: Generator
    not_a_number: str
    """The error of a command that is not finite."""
    moves_at_end = "joint_motion_generator_velocity_discontinuity"
    """The error of a motion that ends while it moves."""
    joints = "joint_motion_generator"
    """Prefix of the errors of the joints' limits."""

    @property
    def commanded(self) -> FloatArray | None:
        """Velocities (2, 7) of end-effector [m/s, rad/s] and elbow [rad/s] and their rates, where these are commanded.

        The end-effector's are as of the base frame, at its origin.
        """
        return None

    @abstractmethod
    def read(self, command: np.void) -> FloatArray:
        """Return what counts of a command."""

    def start(self, values: FloatArray, q: FloatArray) -> FloatArray | None:
        """Return the positions (7,) [rad] at which a first command begins; None if that is not near q (7,) [rad]."""
        return None

    @abstractmethod
    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> JointStep:
        """Return what a command asks for.

        Args:
            values: that count of it, finite.
            q: (7,) commanded positions so far [rad].
            first: whether no command has come before.
        """

    def bridged(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> JointStep:
        """Return what is done in place of a lost command: the same acceleration once more.

        Args:
            q: (7,) commanded positions so far [rad].
            qd: (7,) commanded velocities [rad/s].
            qdd: (7,) commanded accelerations [rad/s^2].
        """
        return JointStep(qd + qdd * PERIOD_S)


class JointVelocity(MotionKind):
    """Velocities (7,) [rad/s]."""

    generator = Generator.JOINT_VELOCITY
    not_a_number = "joint_motion_generator_velocity_limits_violation"

    def read(self, command: np.void) -> FloatArray:
        """Return the velocities."""
        return np.array(command["dq_c"])

    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> JointStep:
        """Take them as they are."""
        return JointStep(values)


class NoMotion(JointVelocity):
    """No motion beside the torques of an external controller: no joint velocity is commanded."""

    generator = Generator.NONE

    def read(self, command: np.void) -> FloatArray:
        """Return zeros, whatever the command says."""
        return np.zeros_like(command["dq_c"])


class JointPosition(MotionKind):
    """Positions (7,) [rad], differentiated backwards as the vendor's documents say."""

    generator = Generator.JOINT_POSITION
    not_a_number = "joint_motion_generator_position_limits_violation"

    def __init__(self, limits: MotionLimits) -> None:
        # The vendor does not say how far the first may be from where the arm is. The acceleration limit would catch
        # what is farther than this; by its name this error says better what is wrong, and on the robot it comes alone.
        self._start_within = limits.qdd * PERIOD_S**2  # [rad]

    def read(self, command: np.void) -> FloatArray:
        """Return the positions."""
        return np.array(command["q_c"])

    def start(self, values: FloatArray, q: FloatArray) -> FloatArray | None:
        """Return the positions themselves."""
        return values if np.all(np.abs(values - q) <= START_RAD) else None

    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> JointStep:
        """Go there within the millisecond; the first must be where the arm is commanded to be already."""
        with np.errstate(over="ignore"):
            qd = (values - q) / PERIOD_S
        if first and np.any(np.abs(values - q) > self._start_within):
            return JointStep(qd, ("joint_position_motion_generator_start_pose_invalid",))
        return JointStep(qd)
