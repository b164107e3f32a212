"""One motion: commands in, what the joints are to do, or why it ended. Pure but for its own memory."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from pretouch.types import FloatArray
from pretouch_fci.controllers import ExternalTorques
from pretouch_fci.kinds import JointPosition, JointStep, MotionKind
from pretouch_fci.limits import PERIOD_S, MotionLimits
from pretouch_fci.wire import JOINTS, ControllerMode

LOST_MOST = 20
"""So many commands lost in a row end a motion."""
FIRST_WITHIN = 500
"""The first command of a motion has to come within so many milliseconds."""
_COUNTED = 100
"""The success rate is of the last so many milliseconds."""
_BRAKES = 0.7
"""Fraction of the acceleration limit with which it brakes: the jerk limit takes the rest."""
_APPROACH_1_S = 20.0
"""Near the target the speed falls with the distance at this rate [1/s]."""
_ENVELOPE = 0.9
"""Fraction of the largest velocity at a position: it falls on the way, and the velocity follows late."""
_FOLLOWS_S = 0.01
"""Time constant of the velocity on its way to the one that is wanted [s]."""


@dataclass(frozen=True, slots=True)
class Setpoint:
    """Values of a command."""

    values: FloatArray
    """Values that this kind of motion uses."""
    finished: bool = False
    """True if the motion ends with it."""
    torques: FloatArray = field(default_factory=lambda: np.zeros(JOINTS))
    """(7,) for an external controller [Nm]."""


@dataclass(frozen=True, slots=True)
class MotionEnding:
    """End of a motion."""

    status: str
    """Status, one of `Protocol.move`."""
    errors: tuple[str, ...] = ()
    """Errors of a reflex."""


class Motion:
    """A motion from its request until it ends."""

    awaited = True
    """True if a command is due in each millisecond."""

    def __init__(
        self,
        limits: MotionLimits,
        controller: ControllerMode,
        kind: MotionKind,
        external: ExternalTorques | None = None,
    ) -> None:
        """Begin at rest; an external controller takes the torques."""
        n = len(limits.qd)
        self._limits, self.controller, self.kind, self._external = limits, controller, kind, external
        self.qd, self.qdd = np.zeros(n), np.zeros(n)
        """Commanded velocities [rad/s] and accelerations [rad/s^2], (n,)."""
        self.begun = False
        """True if a command has come."""
        self._lost = 0
        self._received: deque[bool] = deque(maxlen=_COUNTED)

    @property
    def success_rate(self) -> float:
        """Fraction of the last commands that were received in time."""
        return sum(self._received) / len(self._received) if self._received else 0.0

    def follow(self, q: FloatArray, setpoint: Setpoint | None) -> MotionEnding | None:
        """Take the command of a millisecond, None if it was lost, at commanded positions q (n,) [rad].

        Where it ended, the commanded velocities are the last ones: whoever moves the arm brakes from there.
        """
        if setpoint is None:
            return self._without(q)
        first, self.begun, self._lost = not self.begun, True, 0
        self._received.append(True)
        if not np.all(np.isfinite(setpoint.values)):
            return MotionEnding("input error", (self.kind.not_a_number,))
        if self._external is not None and not np.all(np.isfinite(setpoint.torques)):
            return MotionEnding("input error", ("controller_torque_discontinuity",))
        if setpoint.finished:
            if np.all(np.abs(self.qd) <= self._limits.qdd * PERIOD_S):  # the acceleration limit stops it at once
                return MotionEnding("success")
            return MotionEnding("reflex", (self.kind.moves_at_end,))
        errors = () if self._external is None else self._external.take(setpoint.torques)
        return MotionEnding("reflex", errors) if errors else self._moved(q, self.kind.asked(setpoint.values, q, first))

    def _without(self, q: FloatArray) -> MotionEnding | None:
        """Go on with the same acceleration, as the robot does for a lost command."""
        self._lost += 1
        if self._lost >= (LOST_MOST if self.begun else FIRST_WITHIN):
            return MotionEnding("reflex", ("communication_constraints_violation",))
        if not self.begun:
            return None
        self._received.append(False)
        return self._moved(q, self.kind.bridged(q, self.qd, self.qdd))

    def _moved(self, q: FloatArray, step: JointStep) -> MotionEnding | None:
        errors = step.errors or self._limits.violated(q, self.qd, self.qdd, step.qd, self.kind.joints)
        if errors:
            return MotionEnding("reflex", errors)
        self.qdd = (step.qd - self.qd) / PERIOD_S
        self.qd = step.qd
        return None


class TargetMotion(Motion):
    """A motion to positions that come now and then, as of libfranka's asynchronous control: the robot finds the way.

    Each joint by itself speeds up and brakes within its limits, until a target comes that is another. The vendor does
    not say how its robot goes there; that its commands may come at any rate, it does.
    """

    awaited = False

    def __init__(self, limits: MotionLimits, controller: ControllerMode, fastest: FloatArray) -> None:
        """Begin at rest; `fastest` (7,) are the largest velocities on the way [rad/s]."""
        super().__init__(limits, controller, JointPosition(limits))
        self._fastest = np.minimum(fastest, limits.qd)
        self._target: FloatArray | None = None

    def follow(self, q: FloatArray, setpoint: Setpoint | None) -> MotionEnding | None:
        """Go on towards the newest target; none is lost, and the last command has the arm brake."""
        self.begun |= setpoint is not None
        if setpoint is not None:
            if not np.all(np.isfinite(setpoint.values)):
                return MotionEnding("input error", (self.kind.not_a_number,))
            if setpoint.finished:
                return MotionEnding("success")
            self._target = setpoint.values
        if self._target is None:
            return self._without(q)
        self._received.append(True)
        return self._moved(q, JointStep(self._towards(self._target, q)))

    def _towards(self, target: FloatArray, q: FloatArray) -> FloatArray:
        """Return the next velocities (7,) [rad/s] on the way from q (7,) to a target (7,) [rad]."""
        brakes, left = _BRAKES * self._limits.qdd, target - q
        far = np.abs(left)
        near = brakes / _APPROACH_1_S**2
        goal = np.where(far < near, _APPROACH_1_S * far, np.sqrt(2 * brakes * np.maximum(far - near / 2, 0.0)))
        least, greatest = self._limits.speeds(q)
        goal = np.clip(np.sign(left) * np.minimum(goal, self._fastest), _ENVELOPE * least, _ENVELOPE * greatest)
        most, jerk = self._limits.qdd, self._limits.qddd * PERIOD_S
        acceleration = np.clip((goal - self.qd) / _FOLLOWS_S, -most, most)
        return self.qd + PERIOD_S * (self.qdd + np.clip(acceleration - self.qdd, -jerk, jerk))
