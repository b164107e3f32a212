"""A motion to positions that come now and then, as of libfranka's asynchronous control: the robot finds the way."""

import numpy as np

from pretouch.types import FloatArray
from pretouch_fci.kinds import Asked, JointPosition
from pretouch_fci.limits import PERIOD_S, MotionLimits
from pretouch_fci.motion import Ending, Motion, Setpoint
from pretouch_fci.wire import Controller

_BRAKES = 0.7
"""Fraction of the acceleration limit with which it brakes: the jerk limit takes the rest."""
_APPROACH_1_S = 20.0
"""Near the target the speed falls with the distance at this rate [1/s]."""
_ENVELOPE = 0.9
"""Fraction of the largest velocity at a position: it falls on the way, and the velocity follows late."""
_FOLLOWS_S = 0.01
"""Time constant of the velocity on its way to the one that is wanted [s]."""


class TargetMotion(Motion):
    """Each joint by itself speeds up and brakes within its limits, until a target comes that is another.

    The vendor does not say how its robot goes there; that its commands may come at any rate, it does.
    """

    awaited = False

    def __init__(self, limits: MotionLimits, controller: Controller, fastest: FloatArray) -> None:
        """Begin at rest; `fastest` (7,) are the largest velocities on the way [rad/s]."""
        super().__init__(limits, controller, JointPosition(limits))
        self._fastest = np.minimum(fastest, limits.qd)
        self._target: FloatArray | None = None

    def follow(self, q: FloatArray, setpoint: Setpoint | None) -> Ending | None:
        """Go on towards the newest target; none is lost, and the last command has the arm brake."""
        self.begun |= setpoint is not None
        if setpoint is not None:
            if not np.all(np.isfinite(setpoint.values)):
                return Ending("input error", (self.kind.not_a_number,))
            if setpoint.finished:
                return Ending("success")
            self._target = setpoint.values
        if self._target is None:
            return self._without(q)
        self._received.append(True)
        return self._moved(q, Asked(self._towards(self._target, q)))

    def _towards(self, target: FloatArray, q: FloatArray) -> FloatArray:
        """Return the next velocities (7,) [rad/s] on the way from q (7,) to a target (7,) [rad]."""
        brakes, left = _BRAKES * self._limits.qdd, target - q
        far = np.abs(left)
        near = brakes / _APPROACH_1_S**2
        wanted = np.where(far < near, _APPROACH_1_S * far, np.sqrt(2 * brakes * np.maximum(far - near / 2, 0.0)))
        least, greatest = self._limits.speeds(q)
        wanted = np.clip(np.sign(left) * np.minimum(wanted, self._fastest), _ENVELOPE * least, _ENVELOPE * greatest)
        most, jerk = self._limits.qdd, self._limits.qddd * PERIOD_S
        acceleration = np.clip((wanted - self.qd) / _FOLLOWS_S, -most, most)
        return self.qd + PERIOD_S * (self.qdd + np.clip(acceleration - self.qdd, -jerk, jerk))
