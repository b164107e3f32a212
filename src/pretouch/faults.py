"""Which inputs to believe: faults of the inputs, distinguished before anything is computed from them."""

from dataclasses import replace

import numpy as np

from pretouch.compiled import compiled
from pretouch.modes import Event
from pretouch.params import FailureParams
from pretouch.perception.chosen_points import FARTHEST, LARGEST_SIGMA, usable
from pretouch.types import (
    WHOLE,
    FloatArray,
    Inputs,
    RangeReadings,
    RangeStatus,
    RobotState,
    SeenPoints,
    TouchReadings,
)
from pretouch.values import real, real_number, value

_LARGEST = 1e3
"""A joint position or velocity [rad, rad/s] from here on is none: another unit, or a broken message."""

_FASTEST = 2.0
"""Times the arm's limit: a commanded joint velocity from here on is none that any arm was ever given."""

_STRONGEST = 1e4
"""An external torque [Nm] from here on is none."""

_LATEST = 1e12
"""A time stamp [s] from here on is none, whatever the clock began with."""

MOST_POINTS = 20_000
"""Points of outside sources that are taken in one step: what they cost stays bounded."""

_PARTS = ("joint positions", "joint velocities", "commanded joint positions", "commanded joint velocities")


@value
class Watch:
    """What is remembered to judge the next inputs."""

    stamp: float
    """Instant of the last step [s], always finite."""
    robot: RobotState
    """The last state that was believed."""
    force_stamp: float
    """When the robot last gave a force estimate [s]."""
    sent: tuple[tuple[float, FloatArray], ...] = ()
    """Instants [s] and joint velocities (n,) [rad/s] of the commands that the last state may not know yet."""


def watch_init(robot: RobotState) -> Watch:
    """Begin with a state that is known to be good."""
    return Watch(robot.stamp, robot, robot.stamp)


def examine(
    watch: Watch,
    inputs: Inputs,
    command: FloatArray,
    period: float,
    qd_max: FloatArray,
    params: FailureParams,
    torques: bool = False,
) -> tuple[RobotState, dict[Event, str], Watch]:
    """Return the robot state to go by, the faults found, and what to remember.

    In place of a state that cannot be believed stands the last one that could, moved on by the last command. One from
    before the last command, lost or late, is moved on by the commands it cannot know of: the next one may differ from
    the last one sent by so much only. What is returned shares no memory with the inputs.

    Args:
        watch: memory.
        inputs: of this step.
        command: (n,) last joint velocity command [rad/s].
        period: time that command was held [s].
        qd_max: (n,) joint velocity limits [rad/s].
        params: time limits.
        torques: whether the torques of the external force are needed, rather than the force.
    """
    faults: dict[Event, str] = {}
    robot, wrong = sound_robot(inputs.robot, qd_max)
    stamp = time_of(inputs.stamp)
    now = watch.stamp if stamp is None else stamp
    if robot is None:
        faults[Event.UNUSABLE] = wrong
    elif stamp is None:
        faults[Event.UNUSABLE] = f"the step's time stamp is {inputs.stamp}"
    elif abs(now - robot.stamp) > params.state_timeout_s:
        faults[Event.STATE_STALE] = _stale(now - robot.stamp)
    sent = (*watch.sent[-int(params.state_timeout_s / period) - 1 :], (watch.stamp, command))
    if now < watch.stamp:
        faults[Event.TIME_BACKWARDS] = f"from {watch.stamp:.3f} s to {now:.3f} s"
        sent = ()
    if robot is None or faults:
        last = watch.robot
        believed = replace(
            last, q_commanded=last.q_commanded + command * period, qd_commanded=command,
            tau_ext=np.full(len(last.q), np.nan), wrench=None,
        )  # fmt: skip
        return believed, faults, Watch(now, believed, min(watch.force_stamp, now), sent)
    if robot.stamp <= watch.stamp < now:
        robot = replace(robot, q_commanded=_moved_on(robot, now, sent), qd_commanded=command)
    if robot.wrench is not None and not below(robot.wrench, params.force_max_n):
        robot = replace(robot, wrench=None)
    missing = not below(robot.tau_ext, _STRONGEST) if torques else robot.wrench is None
    force_stamp = min(watch.force_stamp, now) if missing else now
    if now - watch.stamp > params.overrun_s:
        faults[Event.OVERRUN] = f"{now - watch.stamp:.3f} s"
    if now - force_stamp > params.force_timeout_s:
        faults[Event.NO_FORCE] = f"{now - force_stamp:.2f} s"
    return robot, faults, Watch(now, robot, force_stamp, sent)


def _stale(age: float) -> str:
    """Say how old a state is [s], why that may be, and what to do."""
    if age < 0:
        return f"{-age:.3f} s in the future: let one clock stamp states and steps"
    return (
        f"{age:.3f} s old, for this machine is busy, perhaps without a real-time kernel, or the connection is slow:"
        " close other programs and check the connection to the arm"
    )


def _moved_on(robot: RobotState, now: float, sent: tuple[tuple[float, FloatArray], ...]) -> FloatArray:
    """Commanded joint positions (n,) [rad] by now of an arm that was sent these commands after its report."""
    q, ends = robot.q_commanded, [start for start, _ in sent[1:]]
    for i, (end, (start, command)) in enumerate(zip([*ends, now], sent, strict=True)):
        # what came before the first of them is not known, and taken to be the same
        held = end - (max(start, robot.stamp) if i else robot.stamp)
        if held > 0:
            q = q + command * held
    return q


def time_of(stamp: float) -> float | None:
    """Return a time stamp, or None if it is none."""
    try:
        time = real_number(stamp)
    except (TypeError, ValueError, OverflowError):
        return None
    return time if abs(time) < _LATEST else None


def sound_robot(robot: RobotState, qd_max: FloatArray) -> tuple[RobotState | None, str]:
    """Copy a robot's state as arrays of float64, or say what keeps it from being that of an arm with these limits.

    External torques that an arm cannot have are NaN.
    """
    n = len(qd_max)
    try:
        stamp, given = time_of(robot.stamp), (robot.q, robot.qd, robot.q_commanded, robot.qd_commanded)
        tau_ext, wrench = robot.tau_ext, None if robot.wrench is None else real(robot.wrench)
    except AttributeError:
        return None, f"it is {robot!r}"
    except (TypeError, ValueError, OverflowError):
        return None, "its force estimate is not an array of numbers"
    if stamp is None:
        return None, f"its time stamp is {robot.stamp}"
    numbers = _numbers((*given, tau_ext), n)
    if numbers is None:  # the torques may be missing, the others not
        numbers = _numbers((*given, np.full(n, np.nan)), n)
    if numbers is None:
        return None, _misfit(given, n)
    if wrench is not None and wrench.shape != (6,):
        return None, f"its force estimate has the shape {wrench.shape}, not (6,)"
    if not _plausible(numbers, qd_max):
        bounds = np.vstack([np.full((3, n), _LARGEST), _FASTEST * qd_max])
        i, j = np.argwhere(~(np.abs(numbers[:4]) < bounds))[0]
        return None, f"{_PARTS[i]} hold {numbers[i, j]:g}"
    return RobotState(stamp, numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], wrench), ""


def _numbers(given: tuple[object, ...], joints: int) -> FloatArray | None:
    """Copy what is a number a joint to one array (5, n) of float64; None if a part is something else."""
    try:
        numbers = real(given)
    except (TypeError, ValueError, OverflowError):
        return None
    return numbers if numbers.shape == (len(given), joints) else None


@compiled
def _plausible(numbers: FloatArray, qd_max: FloatArray) -> bool:
    """Whether an arm can have these (5, n) positions, velocities, and commanded ones; not if one is NaN.

    The last row are external torques: all of them are made NaN where an arm cannot have one.
    """
    for j in range(len(qd_max)):
        for i in range(3):
            if not abs(numbers[i, j]) < _LARGEST:
                return False
        if not abs(numbers[3, j]) < _FASTEST * qd_max[j]:
            return False
    if not below(numbers[4], _STRONGEST):
        numbers[4] = np.nan
    return True


def _misfit(given: tuple[FloatArray, ...], joints: int) -> str:
    """Name the first part of a robot's state that is no array of a number a joint, or ''."""
    for name, part in zip(_PARTS, given, strict=True):
        try:
            shape = np.shape(part)
            if shape == (joints,):
                real(part)
        except (TypeError, ValueError, OverflowError):
            return f"{name} are not arrays of numbers"
        if shape != (joints,):
            return f"{name} have the shape {shape}, not ({joints},)"
    return ""


def sound_readings(readings: RangeReadings, units: int) -> tuple[RangeReadings, str]:
    """Copy readings as arrays of float64 and int64; of those that do not fit so many units, take none and say why."""
    try:
        stamp = real(readings.stamp)
        distance = real(readings.distance)
        status = np.array(readings.status)
    except AttributeError:
        return _nothing(units), f"they are {readings!r}"
    except (TypeError, ValueError, OverflowError):
        return _nothing(units), "they are not arrays of numbers"
    if not stamp.shape == distance.shape == status.shape == (units,):
        shapes = f"{stamp.shape}, {distance.shape} and {status.shape}"
        return _nothing(units), f"stamps, distances and statuses have the shapes {shapes}, not ({units},)"
    if status.dtype is not WHOLE:
        if status.dtype.kind not in "iu":
            return _nothing(units), f"statuses are of type {status.dtype}, not whole numbers"
        status = status.astype(np.int64)
    return RangeReadings(stamp, distance, status), ""


def _nothing(units: int) -> RangeReadings:
    """Return what units report that were never heard."""
    return RangeReadings(np.full(units, -np.inf), np.zeros(units), np.full(units, int(RangeStatus.NONE)))


def sound_touch(touch: TouchReadings | None, units: int) -> tuple[TouchReadings | None, str]:
    """Copy touch readings as arrays of known types; of those that do not fit so many units, take none and say why.

    A stamp that is no number is that of a unit that was never heard; a force that is no number, or below 0, is not
    measured. None stays None: a skin without touch sensors.
    """
    if touch is None:
        return None, ""
    try:
        stamp, force = real(touch.stamp), real(touch.force)
        contact, status = np.array(touch.contact), np.array(touch.status)
    except AttributeError:
        return None, f"touch readings are {touch!r}"
    except (TypeError, ValueError, OverflowError):
        return None, "touch readings are not arrays of numbers"
    if not stamp.shape == force.shape == contact.shape == status.shape == (units,):
        shapes = f"{stamp.shape}, {contact.shape}, {force.shape} and {status.shape}"
        return None, f"stamps, contacts, forces and statuses of touch have the shapes {shapes}, not ({units},)"
    if contact.dtype.kind not in "biu" or status.dtype.kind not in "iu":
        return None, f"contacts and statuses of touch are of types {contact.dtype} and {status.dtype}"
    stamp[np.isnan(stamp)] = -np.inf
    force[~((force >= 0.0) & (force < _STRONGEST))] = np.nan
    return TouchReadings(stamp, contact != 0, force, status.astype(np.int64)), ""


def sound_points(points: SeenPoints | None) -> tuple[SeenPoints | None, str]:
    """Give points of outside sources as arrays of float64; of those that cannot be used, take none and say why.

    A set of which more than half the points are implausible cannot be used; single ones are left out later. No copy
    is made, for nothing of the arrays is kept beyond the step.
    """
    if points is None:
        return None, ""
    try:
        heard = real_number(points.heard)
        given = points.stamp, points.point, points.sigma
        stamp, point, sigma = (np.ascontiguousarray(real(part, copy=False)) for part in given)
    except AttributeError:
        return None, f"gives {points!r}"
    except (TypeError, ValueError, OverflowError):
        return None, "gives something other than arrays of numbers"
    if stamp.shape != sigma.shape or point.shape != (*stamp.shape, 3) or stamp.ndim != 1:
        return None, f"gives stamps, points and sigmas of the shapes {stamp.shape}, {point.shape} and {sigma.shape}"
    if len(stamp) > MOST_POINTS:
        return None, f"gives {len(stamp)} points, more than {MOST_POINTS}"
    good, none = usable(stamp, point, sigma)
    if 2 * good < len(stamp) - none:
        shown = len(stamp) - none
        return None, (
            f"gives {shown - good} implausible points of {shown}: a coordinate of {FARTHEST:g} m or more, or a sigma"
            f" outside 0 to {LARGEST_SIGMA:g} m"
        )
    return SeenPoints(heard, stamp, point, sigma), ""


@compiled
def below(numbers: FloatArray, bound: float) -> bool:
    """Whether all numbers (k,) are smaller than a bound in size; one that is NaN is not."""
    for number in numbers:  # noqa: SIM110  compiled code knows no generators
        if not abs(number) < bound:
            return False
    return True
