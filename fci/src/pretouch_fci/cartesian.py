"""Motions of the end-effector, by poses or velocities: limits, elbow, and the joints that follow."""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from pretouch.control.commander import rotation_about
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_fci.frames import Frames, pose, pose_of
from pretouch_fci.kinds import START_M, START_RAD, JointStep, MotionKind
from pretouch_fci.limits import PERIOD_S, SLACK
from pretouch_fci.wire import JOINTS, Generator, RobotKind

_NEWTON_STEPS = 2
"""A pose is a millisecond away: the first step leaves a square of what it goes, the second the square of that."""
_ELBOW, _ELBOW_SIGN = 2, 3
"""The joint whose angle is the elbow's, and the one whose sign says to which side it is bent."""
_PARTS = (slice(0, 3), slice(3, 6), slice(6, 7))
"""Translation, rotation and elbow in velocities (7,)."""
_PREFIX = "cartesian_motion_generator"


@dataclass(frozen=True, slots=True)
class CartesianLimits:
    """Limits of translation [m], rotation [rad] and elbow [rad], each per second, squared and cubed."""

    velocity: tuple[float, float, float]
    acceleration: tuple[float, float, float]
    jerk: tuple[float, float, float]

    def violated(self, now: FloatArray, command: FloatArray) -> tuple[str, ...]:
        """Return the errors (none: it may be followed) of the next velocities.

        Args:
            now: (2, 7) velocities of end-effector [m/s, rad/s] and elbow [rad/s], and their rates.
            command: (7,) velocities for the next millisecond, likewise.
        """
        rate = (command - now[0]) / PERIOD_S
        jerk = (rate - now[1]) / PERIOD_S
        checks = (
            ("velocity_limits_violation", command, self.velocity),
            ("velocity_discontinuity", rate, self.acceleration),
            ("acceleration_discontinuity", jerk, self.jerk),
        )
        within = {
            name: [math.hypot(*values[part]) <= most * (1 + SLACK) for part, most in zip(_PARTS, limits, strict=True)]
            for name, values, limits in checks
        }
        errors = [f"{_PREFIX}_{name}" for name, (line, turn, _) in within.items() if not (line and turn)]
        if not all(elbow for _, _, elbow in within.values()):
            errors.append(f"{_PREFIX}_elbow_limit_violation")
        return tuple(errors)


CARTESIAN_LIMITS: dict[RobotKind, CartesianLimits] = {
    "panda": CartesianLimits((2.0, 2.5, 2.175), (13.0, 25.0, 10.0), (6500.0, 12500.0, 5000.0)),
    "fr3": CartesianLimits((3.0, 2.5, 1.5), (9.0, 17.0, 10.0), (4500.0, 8500.0, 5000.0)),
}
"""Those of libfranka 0.9 and 0.21, `rate_limiting.h`, without what it leaves for lost commands."""


class ArmBody(NamedTuple):
    """The arm that moves, and where its end-effector is."""

    model: RobotModel
    frames: Frames
    limits: CartesianLimits

    def end_effector(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pose (4, 4) of the end-effector at positions q (7,) [rad], and its Jacobian (6, 7)."""
        kin, flange = self.model.kinematics(q), self.frames.flange
        T = pose(kin, flange) @ self.frames.F_T_EE
        return T, self.model.jacobian(kin, flange, T[:3, 3])


class _OfEndEffector(MotionKind):
    """Common part of both kinds of motion of the end-effector."""

    moves_at_end = f"{_PREFIX}_velocity_discontinuity"
    joints = f"{_PREFIX}_joint"
    field: str
    """Field of a command, beside the elbow."""
    _size: int
    """Numbers in the field."""

    def __init__(self, body: ArmBody) -> None:
        self._body, self._with_elbow = body, False
        self._now = np.zeros((2, JOINTS))

    @property
    def commanded(self) -> FloatArray:
        """Velocities and rates; those of an elbow that is not commanded are 0."""
        return self._now

    def read(self, command: np.void) -> FloatArray:
        """Return the field, with angle and sign of the elbow behind it where these are commanded."""
        elbow = command["elbow_c"] if command["valid_elbow"] else ()
        return np.concatenate([command[self.field], elbow])

    def asked(self, values: FloatArray, q: FloatArray, first: bool) -> JointStep:
        """Have the joints lead the end-effector there, if it may go there."""
        field, elbow = np.split(values, [self._size])
        errors = self._elbow_errors(elbow, q, first)
        if errors:
            return JointStep(np.zeros(JOINTS), errors)
        self._with_elbow = len(elbow) > 0
        with np.errstate(over="ignore", invalid="ignore"):  # what becomes of a number that is too large breaks limits
            return self._of_field(field, q, float(elbow[0]) if self._with_elbow else None, first)

    def bridged(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> JointStep:
        """Go on with the same acceleration of end-effector and elbow."""
        going = self._now[0] + self._now[1] * PERIOD_S
        elbow = q[_ELBOW] + going[6] * PERIOD_S if self._with_elbow else None
        return self._follow(q, going[:6], elbow)

    @abstractmethod
    def _of_field(self, field: FloatArray, q: FloatArray, elbow: float | None, first: bool) -> JointStep:
        """Return what the field asks for, with the elbow's angle [rad] if there is one."""

    def _elbow_errors(self, elbow: FloatArray, q: FloatArray, first: bool) -> tuple[str, ...]:
        if not len(elbow):
            return ()
        inconsistent = elbow[1] * q[_ELBOW_SIGN] <= 0
        # how far it may be off at first is our choice, as for positions of joints
        if first and (inconsistent or abs(elbow[0] - q[_ELBOW]) > self._body.limits.acceleration[2] * PERIOD_S**2):
            return (f"{_PREFIX}_start_elbow_invalid",)
        return (f"{_PREFIX}_elbow_sign_inconsistent",) if inconsistent else ()

    def _follow(self, q: FloatArray, twist: FloatArray, elbow: float | None, T: FloatArray | None = None) -> JointStep:
        """Check velocities (6,) of the end-effector and find the joints that lead it to T, or where they lead."""
        speed = 0.0 if elbow is None else (elbow - q[_ELBOW]) / PERIOD_S
        velocities = np.append(twist, speed)
        errors = self._body.limits.violated(self._now, velocities)
        if errors:
            return JointStep(np.zeros(JOINTS), errors)
        self._now = np.stack([velocities, (velocities - self._now[0]) / PERIOD_S])
        if T is None:
            T = _advanced(self._body.end_effector(q)[0], twist)
        return JointStep((self._reached(q, T, elbow) - q) / PERIOD_S)

    def _reached(self, q: FloatArray, T: FloatArray, elbow: float | None) -> FloatArray:
        """Positions (7,) [rad] near q with the end-effector at T (4, 4): with this elbow, or with the least motion."""
        reached = q
        for _ in range(_NEWTON_STEPS):
            now, J = self._body.end_effector(reached)
            missing = difference(T, now)
            if elbow is not None:
                J, missing = np.vstack([J, np.eye(JOINTS)[_ELBOW]]), np.append(missing, elbow - reached[_ELBOW])
            reached = reached + np.linalg.pinv(J) @ missing
        return reached


class CartesianVelocity(_OfEndEffector):
    """Velocities (6,) of the end-effector's origin [m/s] and orientation [rad/s], base frame."""

    generator, field, _size = Generator.CARTESIAN_VELOCITY, "O_dP_EE_c", 6
    not_a_number = f"{_PREFIX}_velocity_limits_violation"

    def _of_field(self, field: FloatArray, q: FloatArray, elbow: float | None, first: bool) -> JointStep:
        return self._follow(q, field, elbow)


class CartesianPose(_OfEndEffector):
    """Poses of the end-effector (16,), column by column, differentiated backwards."""

    generator, field, _size = Generator.CARTESIAN_POSITION, "O_T_EE_c", 16
    not_a_number = "cartesian_position_motion_generator_invalid_frame"

    def start(self, values: FloatArray, q: FloatArray) -> FloatArray | None:
        """Return positions near q with end-effector and elbow as commanded."""
        field, elbow = np.split(values, [self._size])
        T = pose_of(field)
        if T is None or not np.all(np.abs(elbow[:1] - q[_ELBOW]) <= START_RAD):
            return None
        off = difference(T, self._body.end_effector(q)[0])
        if math.hypot(*off[:3]) > START_M or math.hypot(*off[3:]) > START_RAD:
            return None
        return self._reached(q, T, float(elbow[0]) if len(elbow) else None)

    def _of_field(self, field: FloatArray, q: FloatArray, elbow: float | None, first: bool) -> JointStep:
        T = pose_of(field)
        if T is None:
            return JointStep(np.zeros(JOINTS), (self.not_a_number,))
        twist = difference(T, self._body.end_effector(q)[0]) / PERIOD_S
        # how far it may be off at first is our choice, as for positions of joints
        line, turn, _ = (most * PERIOD_S for most in self._body.limits.acceleration)
        if first and (math.hypot(*twist[:3]) > line or math.hypot(*twist[3:]) > turn):
            return JointStep(np.zeros(JOINTS), ("cartesian_position_motion_generator_start_pose_invalid",))
        return self._follow(q, twist, elbow, T)


def _advanced(T: FloatArray, twist: FloatArray) -> FloatArray:
    """Return where velocities (6,) [m/s, rad/s] lead a pose (4, 4) in a millisecond."""
    there, speed = T.copy(), math.hypot(*twist[3:])
    there[:3, 3] += twist[:3] * PERIOD_S
    if speed > 0:
        there[:3, :3] = rotation_about(twist[3:] / speed, speed * PERIOD_S) @ T[:3, :3]
    return there


def difference(there: FloatArray, here: FloatArray) -> FloatArray:
    """Translation [m] and rotation vector [rad] (6,) from a pose (4, 4) to another, base frame."""
    D = there[:3, :3] @ here[:3, :3].T
    sines = 0.5 * np.array([D[2, 1] - D[1, 2], D[0, 2] - D[2, 0], D[1, 0] - D[0, 1]])
    sine, cosine = math.hypot(*sines), 0.5 * (float(np.trace(D)) - 1.0)
    if sine > 0:
        turn = sines * (math.atan2(sine, cosine) / sine)
    else:  # none, or half a turn: about which axis does not matter, it is beyond all limits
        turn = np.array([math.pi if cosine < 0 else 0.0, 0.0, 0.0])
    return np.concatenate([there[:3, 3] - here[:3, 3], turn])
