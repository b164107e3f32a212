"""Interpolation of set-points to a velocity each millisecond, within the arm's limits."""

import math
from typing import NamedTuple

from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig, RuckigError, Synchronization

from pretouch.arms.franka.limits import FrankaLimits, LimiterParams
from pretouch.arms.franka.state import JOINTS, FrankaState
from pretouch.errors import RobotError

PERIOD_S = 0.001
_UNHEARD_S = 0.02
"""Longest time that the arm continues while commands are lost [s]: then it stops by itself."""
_REST_RAD_S = 1e-9
_ROUNDING = 1.0 + 1e-9
_BRAKING = 0.7
"""Share of the usable acceleration that the way to rest before a position limit counts on: the rest catches up."""


class _RangeEnd(NamedTuple):
    """One end of a joint's range: at x before it the joint may move at -offset + sqrt(offset^2 + slope x)."""

    zero: float
    offset: float
    slope: float

    def at_most(self, speed: float, x: float) -> float:
        """Return a speed towards this end [rad/s], or what is allowed at x if that is less."""
        if x <= 0.0:
            return 0.0
        if speed * (speed + 2.0 * self.offset) <= self.slope * x:
            return speed
        return self.slope * x / (self.offset + math.sqrt(self.offset**2 + self.slope * x))


class SetPointLimiter:
    """Ruckig's velocity interface, begun anew from the arm's own desired state where a command did not arrive.

    Set-points are followed no faster than lets the arm come to rest before its position limits, and below the speed
    that an FR3 allows where it is. That is a second guard: the controller's joint box is the first.
    """

    def __init__(self, limits: FrankaLimits, params: LimiterParams) -> None:
        self._limits, self._params = limits, params
        self._speed = [params.speed_share * v for v in limits.qd_max.tolist()]
        self._acceleration = [params.acceleration_share * a for a in limits.qdd_max.tolist()]
        jerk = [params.jerk_share * j for j in limits.qddd_max.tolist()]
        self._unheard = (limits.qdd_max * _UNHEARD_S + params.reseed_rad_s).tolist()
        self._ends = _ends(limits, params.position_margin_rad, self._acceleration, jerk)
        self._ruckig, self._output = Ruckig(JOINTS, PERIOD_S), OutputParameter(JOINTS)
        self._input = InputParameter(JOINTS)
        self._input.control_interface = ControlInterface.Velocity
        self._input.synchronization = Synchronization.No
        self._input.max_acceleration, self._input.max_jerk = self._acceleration, jerk
        self._input.target_acceleration = [0.0] * JOINTS
        self.lost = False
        """True if the arm's desired velocity was not what it had been told, at the last step."""
        self._sent: list[float] | None = None

    @property
    def at_rest(self) -> bool:
        """True if the last velocities were zero, but for rounding."""
        return self._sent is not None and max(map(abs, self._sent)) < _REST_RAD_S

    def step(self, state: FrankaState, velocity: list[float]) -> list[float]:
        """Return the velocities (7,) [rad/s] to command in answer to a state, on the way to the requested ones."""
        at, now, changing = state.q_d.tolist(), state.dq_d.tolist(), state.ddq_d.tolist()
        if not all(map(math.isfinite, (*at, *now, *changing))):
            raise RobotError(
                f"The arm reports the desired state {at} rad, {now} rad/s and {changing} rad/s^2, which is not finite:"
                " check the arm and its library."
            )
        sent = self._sent or [0.0] * JOINTS
        far = [i for i in range(JOINTS) if abs(now[i] - sent[i]) > self._unheard[i]]
        if far:
            raise RobotError(
                f"Joint {far[0] + 1} is said to be commanded to {now[far[0]]:.3f} rad/s after {sent[far[0]]:.3f} rad/s,"
                " which no lost command explains: check what else commands the arm, then begin again."
            )
        apart = max(abs(a - b) for a, b in zip(now, sent, strict=True))
        self.lost = self._sent is not None and apart > self._params.reseed_rad_s
        if self._sent is None or self.lost:
            self._input.current_velocity = now
            self._input.current_acceleration = [
                max(-most, min(most, a)) for a, most in zip(changing, self._acceleration, strict=True)
            ]
        self._input.target_velocity = [
            high.at_most(min(v, most), high.zero - q) if v > 0.0 else -low.at_most(min(-v, most), q - low.zero)
            for v, q, most, (low, high) in zip(velocity, at, self._speed, self._ends, strict=True)
        ]
        try:
            self._ruckig.update(self._input, self._output)
        except RuckigError as error:
            raise RobotError(
                f"No motion within the arm's limits starts at its velocities {now} rad/s: check what it reports."
                f" ({str(error).strip()})"
            ) from None
        self._output.pass_to_input(self._input)
        self._sent = list(self._output.new_velocity)
        return self._sent


def _ends(
    limits: FrankaLimits, margin: float, acceleration: list[float], jerk: list[float]
) -> list[tuple[_RangeEnd, _RangeEnd]]:
    """Lower and upper end of each joint's range.

    Braking at a with jerk j from v takes v^2 / 2a + v a / 2j: an end as of `SpeedEnvelope` with slope 2a. Along one
    that is steeper than the brakes are good, the smaller slope and the larger offset are slower everywhere.
    """
    ends = []
    for i, (a, j) in enumerate(zip(acceleration, jerk, strict=True)):
        low, high = float(limits.q_min[i]), float(limits.q_max[i])
        slope, offset = 2.0 * _BRAKING * a, a * (1.5 * a / j + _UNHEARD_S)
        if (e := limits.envelope) is not None:
            short = float(e.offset[i] ** 2 / e.slope[i])
            low, high = max(low, float(e.q_lower[i]) + short), min(high, float(e.q_upper[i]) - short)
            slope, offset = min(slope, float(e.slope[i])), offset + float(e.offset[i])
        ends.append((_RangeEnd(low + margin, offset, slope), _RangeEnd(high - margin, offset, slope)))
    return ends


def refusal(velocity: list[float], limits: FrankaLimits) -> str:
    """Say what keeps a set-point [rad/s] from being one, or ''."""
    if len(velocity) != len(limits.qd_max):
        return f"{len(velocity)} joint velocities were asked for, but it has {len(limits.qd_max)} joints"
    for i, (v, most) in enumerate(zip(velocity, limits.qd_max.tolist(), strict=True)):
        if not math.isfinite(v):
            return f"joint {i + 1} was to move at {v} rad/s, which is not finite"
        if abs(v) > most * _ROUNDING:
            return f"joint {i + 1} was to move at {v:.3f} rad/s (limit {most:g} rad/s)"
    return ""
