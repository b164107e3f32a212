"""The range of joint velocities that keeps position, velocity and acceleration limits, now and later.

A velocity command is held for one period. It is viable if it keeps all limits until the end of its period, and full
braking, which takes `qdd_max * period` off it in each further period, keeps them ever after. No limit rises towards the
end of the range, so braking less hard never keeps a limit that full braking breaks: the largest viable command is the
smallest of what each of the periods to come allows. Both `viable_speed` functions are that minimum in closed form.
"""

from dataclasses import dataclass, field

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.errors import ParameterError
from pretouch.robot.description import SpeedEnvelope
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


@dataclass(frozen=True)
class JointLimits:
    """Limits of n joints, and the period of the controller that must keep them."""

    q_min: FloatArray
    """(n,) [rad]"""
    q_max: FloatArray
    """(n,) [rad]"""
    qd_max: FloatArray
    """(n,) [rad/s]"""
    qdd_max: FloatArray
    """(n,) [rad/s^2]"""
    period: float
    """Duration of a joint velocity command [s]."""
    envelope: SpeedEnvelope | None = None
    """Speed limits that depend on the position; None without any."""
    table: FloatArray = field(init=False, repr=False, compare=False)
    """(9, n) all of the above for compiled code, a joint a column; a slope of 0 stands for no envelope."""

    def __post_init__(self) -> None:
        none = np.zeros(len(self.q_min))
        e = self.envelope
        rows = (none,) * 4 if e is None else (e.offset, e.slope, e.q_upper, e.q_lower)
        table = np.array([self.q_min, self.q_max, self.qd_max, self.qdd_max, none + self.period, *rows])
        object.__setattr__(self, "table", table)


def joint_limits(model: RobotModel, margin: float, period: float) -> JointLimits:
    """Limits of an arm for commands held for `period` [s].

    Args:
        model: the arm.
        margin: distance inside the arm's own limits of those that depend on the position, the envelope included [rad].
        period: [s].

    Raises ParameterError for a margin that leaves a joint nothing of its range.
    """
    arm = model.description
    narrowest = float((model.q_max - model.q_min).min())
    if 2 * margin >= narrowest:
        raise ParameterError(
            f"A margin of {margin:g} rad at both ends leaves nothing of a joint of {arm.name} with a range of"
            f" {narrowest:.3g} rad: choose less than {narrowest / 2:.3g} rad."
        )
    envelope = None if arm.envelope is None else arm.envelope.moved_in(margin)
    return JointLimits(model.q_min + margin, model.q_max - margin, arm.qd_max, arm.qdd_max, period, envelope)


@kernel
def viable_speed(distance: float, acceleration: float, period: float) -> float:
    """Largest speed [rad/s] towards a limit at `distance` [rad] from which braking still ends before it.

    Exact for velocities held over a period: with x = d / (a dt^2) and n = floor((sqrt(1 + 8 x) - 1) / 2) whole
    steps of braking, v = (d / dt + a dt n (n + 1) / 2) / (n + 1). The usual sqrt(2 a d) breaks the limit. Zero at
    the limit and beyond it.
    """
    d, a = max(distance, 0.0), acceleration
    # The most steps n whose braking distance a dt^2 n (n + 1) / 2 fits into d. Where it fits exactly, n and n - 1 give
    # the same speed: a floor that rounding puts one off costs nothing.
    steps = np.floor((np.sqrt(1.0 + 8.0 * d / (a * period**2)) - 1.0) / 2.0)
    # d = (n + 1) v dt - a dt^2 n (n + 1) / 2, solved for v
    return (d / period + a * period * steps * (steps + 1.0) / 2.0) / (steps + 1.0)


@kernel
def viable_speed_in_envelope(distance: float, offset: float, slope: float, acceleration: float, period: float) -> float:
    """Largest speed [rad/s] at `distance` [rad] from an envelope's reference from which braking stays below it.

    Exact for velocities held over a period, at whose end the envelope binds. Speeds are counted in a dt and distances
    in a dt^2: b = slope / (2 a), o the offset, x the distance from where the envelope reaches zero. The command after
    k periods of braking may be u if (u + o)^2 <= 2 b (x - (k + 1) (u + k / 2)) + o^2, so that now it may be
    F(k) = k + u(k) = k + z / (p + sqrt(p^2 + z)) with p = o + b (k + 1) and z = b (2 x - k (k + 1)).

    Where b <= 1 the brakes are stronger than the envelope is steep: F grows with k, and the first period binds. Where
    b > 1 F has its minimum at k = sqrt(((o + b)^2 + 2 b x - b (b - 1) h^2) / b) - h, h = (2 (o + b) - 1) / (2 (b - 1)),
    and either of the whole numbers about it binds; where the root is none, or the minimum lies before the first
    period, F grows and that period binds. Zero where the envelope is zero.
    """
    unit = acceleration * period
    b, o = slope / (2.0 * acceleration), offset / unit
    x = max(distance - offset**2 / slope, 0.0) / (unit * period)  # past its zero the joint has to stand
    speed = _before_period(0.0, x, o, b)
    if b > 1.0:
        h = (2.0 * (o + b) - 1.0) / (2.0 * (b - 1.0))
        square = ((o + b) ** 2 + 2.0 * b * x) / b - (b - 1.0) * h**2
        if square > h**2:
            k = np.floor(np.sqrt(square) - h)
            # F falls to its minimum and rises after it, but periods are whole: one of the two beside it is the least
            speed = min(_before_period(k, x, o, b), _before_period(k + 1.0, x, o, b))
    return speed * unit


@kernel
def _before_period(k: float, x: float, o: float, b: float) -> float:
    """F(k) of `viable_speed_in_envelope`; a command that is at rest by then after full braking keeps any limit."""
    p, z = o + b * (k + 1.0), max(b * (2.0 * x - k * (k + 1.0)), 0.0)
    # u = sqrt(p^2 + z) - p, the positive root of u^2 + 2 p u = z, written without the difference of near numbers
    return k + z / (p + np.sqrt(p**2 + z)) if z > 0.0 else k


@compiled
def joint_box(q: FloatArray, qd: FloatArray, table: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lower and upper bounds (n,) [rad/s] on the next joint velocity command, never empty, and `brake` inside them.

    The box of velocity and position limits, and of the envelope if there is one, is met with what the acceleration
    allows from the last commanded velocity. From a state that is no longer viable acceleration wins: the joint brakes
    at its limit.

    Args:
        q: (n,) commanded joint positions, where the motion generator is [rad].
        qd: (n,) last commanded joint velocities [rad/s].
        table: `JointLimits.table`.
    """
    n = len(q)
    lower, upper = np.empty(n), np.empty(n)
    for i in range(n):
        reach = table[3, i] * table[4, i]
        down, up = _viable(q[i], table, i)
        slowest, fastest = qd[i] - reach, qd[i] + reach
        # acceleration last, so that it wins: an arm beyond the viable range brakes at its limit, and lower <= upper
        lower[i] = np.minimum(np.maximum(down, slowest), fastest)
        upper[i] = np.minimum(np.maximum(up, slowest), fastest)
    return lower, upper, brake(qd, lower, upper, table)


@kernel
def _viable(q: float, table: FloatArray, i: int) -> tuple[float, float]:
    """Lowest and highest viable velocity of joint i at q."""
    speed, a, period = table[2, i], table[3, i], table[4, i]
    up = np.minimum(speed, viable_speed(table[1, i] - q, a, period))
    down = np.minimum(speed, viable_speed(q - table[0, i], a, period))
    offset, slope = table[5, i], table[6, i]
    if slope > 0.0:  # 0 stands for no envelope
        up = np.minimum(up, viable_speed_in_envelope(table[7, i] - q, offset, slope, a, period))
        down = np.minimum(down, viable_speed_in_envelope(q - table[8, i], offset, slope, a, period))
    return -down, up


@kernel
def brake(qd: FloatArray, lower: FloatArray, upper: FloatArray, table: FloatArray) -> FloatArray:
    """Joint velocities (n,) [rad/s] on the shortest way to rest from `qd` that stays inside the box.

    All joints slow by the same factor, so the hand keeps its course, unless the box asks one of them for less.
    """
    needed = 0.0  # periods of full braking until the joint that takes longest is at rest
    for i in range(len(qd)):
        needed = np.maximum(needed, abs(qd[i]) / (table[3, i] * table[4, i]))
    # a period takes the share 1 / needed off each speed; in the last, where needed <= 1, the arm stops
    factor = max(0.0, 1.0 - 1.0 / needed) if needed > 0.0 else 1.0
    command = np.empty(len(qd))
    for i in range(len(qd)):
        command[i] = np.minimum(upper[i], np.maximum(lower[i], qd[i] * factor))
    return command
