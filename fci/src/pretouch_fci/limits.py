"""Limits of the joints in a motion, by the names of the vendor's errors. Pure."""

from dataclasses import dataclass

import numpy as np

from pretouch.robot.description import RobotDescription, SpeedEnvelope
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_fci.wire import RobotKind

PERIOD_S = 0.001
"""The interface's own period [s]."""
_JERK: dict[RobotKind, tuple[float, ...]] = {
    "panda": (7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0),
    "fr3": (5000.0,) * 7,
}
"""Jerk limits [rad/s^3] (libfranka, `rate_limiting.h`)."""
SLACK = 1e-3
"""Fraction beyond a limit that rounding may take."""

_STANDS = 0.05
"""A joint that is measured slower than this may stand: six times the noise [rad/s]."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of the joints (n,), kept on what is commanded."""

    q_min: FloatArray
    """[rad]"""
    q_max: FloatArray
    """[rad]"""
    qd: FloatArray
    """[rad/s]"""
    qdd: FloatArray
    """[rad/s^2]"""
    qddd: FloatArray
    """[rad/s^3]"""
    envelope: SpeedEnvelope | None
    """Limits of the speed that depend on the position, if there are any."""

    def violated(
        self, q: FloatArray, qd: FloatArray, qdd: FloatArray, command: FloatArray, whose: str = "joint_motion_generator"
    ) -> tuple[str, ...]:
        """Return the errors (none: it may be followed) of the next velocity.

        Args:
            q: (n,) commanded positions [rad].
            qd: (n,) commanded velocities [rad/s].
            qdd: (n,) commanded accelerations [rad/s^2].
            command: (n,) velocities for the next millisecond [rad/s].
            whose: what the names of the errors begin with.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            acceleration = (command - qd) / PERIOD_S
            jerk = (acceleration - qdd) / PERIOD_S
            following = q + command * PERIOD_S
        low, high = self.speeds(q)
        # written so that a number that is none is a violation
        within = {
            "velocity_limits_violation": np.all((command >= low) & (command <= high)),
            "velocity_discontinuity": np.all(np.abs(acceleration) <= self.qdd * (1 + SLACK)),
            "acceleration_discontinuity": np.all(np.abs(jerk) <= self.qddd * (1 + SLACK)),
            # a joint that is beyond may go back
            "position_limits_violation": np.all(
                ((following >= self.q_min) | (command >= 0)) & ((following <= self.q_max) | (command <= 0))
            ),
        }
        return tuple(f"{whose}_{name}" for name, allowed in within.items() if not allowed)

    def left(self, q: FloatArray, qd: FloatArray) -> tuple[str, ...]:
        """Return the errors (none: within) of joints that are measured at q [rad] and qd [rad/s], both (n,).

        A joint beyond a limit of its position that stands or goes back is no error.
        """
        leaves = ((q > self.q_max) & (qd > _STANDS)) | ((q < self.q_min) & (qd < -_STANDS))
        errors = {"joint_position_limits_violation": leaves, "joint_velocity_violation": np.abs(qd) > self.qd}
        return tuple(name for name, wrong in errors.items() if wrong.any())

    def braked(self, qd: FloatArray) -> FloatArray:
        """Return the velocities (n,) [rad/s] one millisecond of braking later."""
        return np.asarray(np.sign(qd) * np.maximum(0.0, np.abs(qd) - self.qdd * PERIOD_S))

    def speeds(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return least and greatest velocities (n,) [rad/s] at q (n,) [rad]."""
        fastest = self.qd * (1 + SLACK)
        if self.envelope is None:
            return -fastest, fastest
        e = self.envelope
        up = np.sqrt(np.maximum(0.0, e.slope * (e.q_upper - q))) - e.offset
        down = np.sqrt(np.maximum(0.0, e.slope * (q - e.q_lower))) - e.offset
        spare = SLACK * self.qd
        return -np.minimum(fastest, np.maximum(0.0, down) + spare), np.minimum(fastest, np.maximum(0.0, up) + spare)


def motion_limits(model: RobotModel, kind: RobotKind) -> MotionLimits:
    """Return the limits of an arm."""
    d: RobotDescription = model.description
    return MotionLimits(model.q_min, model.q_max, d.qd_max, d.qdd_max, np.array(_JERK[kind]), d.envelope)
