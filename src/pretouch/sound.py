"""Checks of the inputs: copies with known types, sizes and bounds, or the reason why an input is refused."""

import reprlib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np

from pretouch.desired import Desired, DesiredKind
from pretouch.inputs import (
    Inputs,
    MovingFixtures,
    Payload,
    RangeReadings,
    RangeStatus,
    RobotState,
    SeenPoints,
    TouchReadings,
)
from pretouch.perception.external_points import FARTHEST, LARGEST_SIGMA, usable
from pretouch.records import Flat
from pretouch.robot.kinematics import below
from pretouch.values import LATEST, WHOLE, Below, BoolArray, FloatArray, IntArray, real, real_number

Input = TypeVar("Input")

FASTEST = 2.0
"""Times the arm's limit: a commanded joint velocity of that size was never sent to an arm."""

STRONGEST = 1e4
"""An external torque [Nm] of this size is no measurement."""

MOST_POINTS = 20_000
"""Points of outside sources in one step, at most: their cost stays bounded."""

_MOST_INSTANTS = 1000
_ROUNDING = 1e-6
"""By how much the columns of a rotation may miss unit length and right angles."""
_AHEAD_S = 60.0
"""A horizon that begins so far in the future has the stamps of another clock."""
_WIDTH = {DesiredKind.TWIST: 6, DesiredKind.POSE: 12}


class _Field(NamedTuple):
    """Declaration of a field of an input class."""

    name: str
    kind: Any
    dimensions: tuple[str | int, ...]
    below: float


@cache
def _fields(record: Any) -> list[_Field]:
    fields = []
    for name, hint in get_type_hints(record, include_extras=True).items():
        kind, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        limits = [note.limit for note in notes if isinstance(note, Below)]
        fields.append(_Field(name, kind, tuple(notes[: len(notes) - len(limits)]), min(limits, default=np.inf)))
    return fields


def _of_kind(numbers: object, kinds: str) -> Any:
    array = np.array(numbers)
    if array.dtype.kind not in kinds:
        raise TypeError(f"numbers of type {array.dtype}")
    return array


_COPY: dict[Any, Callable[[Any], Any]] = {
    float: real_number,
    FloatArray: real,
    FloatArray | None: lambda numbers: None if numbers is None else real(numbers),
    IntArray: lambda numbers: _of_kind(numbers, "iu").astype(np.int64),
    BoolArray: lambda numbers: _of_kind(numbers, "biu") != 0,
}
"""Functions that copy a field, by its annotation; a field with another annotation is taken as it is."""
_WORDS = {float: "number", IntArray: "array of whole numbers", BoolArray: "array of yes and no"}


def copy_input(record: type[Input], source: object, **sizes: int) -> tuple[Input | None, str]:
    """Copy an input as a value of its class, with the types, sizes and bounds that the class declares.

    For another object return None and the reason. `sizes` are the sizes of known dimensions; the first field with
    another dimension determines its size.
    """
    values = dict[str, Any]()
    for name, kind, dimensions, limit in _fields(record):  # type: ignore[arg-type]
        field = f"{record.__name__}.{name}"
        try:
            value = getattr(source, name)
            number = values[name] = _COPY[kind](value) if kind in _COPY else value
        except AttributeError:
            return None, f"{reprlib.repr(source)} is no {record.__name__}"
        except (TypeError, ValueError, OverflowError):
            return None, f"{field} is {reprlib.repr(value)}, no {_WORDS.get(kind, 'array of numbers')}"
        if dimensions and number is not None:
            shape, named = number.shape, zip(dimensions, number.shape, strict=False)
            sized = tuple(sizes.setdefault(d, size) if isinstance(d, str) else d for d, size in named)
            if sized != shape or len(dimensions) != len(shape):
                right = tuple(sizes.get(str(d), d) for d in dimensions)
                return None, f"{field} has the shape {shape}, not {right}"
            # another order in memory would be compiled for anew, while the arm waits
            number = values[name] = np.ascontiguousarray(number)
        if limit < np.inf and not (small := np.abs(number) < limit).all():
            return None, f"{field} holds {np.ravel(number)[~np.ravel(small)][0]:g}, no number below {limit:g} in size"
    return record(**values), ""


class UsualInputs:
    """Copies the inputs of nearly every step: reports of the arm and its units, of the usual types, and no others."""

    def __init__(self, blank: Flat) -> None:
        """Take the values that a step starts from, see `line_records.Now`."""
        at = {name: place.at for name, place in blank.places.items()}
        self._joints = slice(at["robot.q"].start, at["robot.wrench"].stop)
        self._readings = slice(at["readings.stamp"].start, at["readings.distance"].stop)
        self._status, self._stamps = at["readings.status"], (at["stamp"].start, at["robot.stamp"].start)
        n, self._units = len(blank.get("robot.q")), len(blank.get("readings.status"))
        self._sizes = [n, n, n, n, n, 6]

    def copy(self, now: Flat, inputs: Inputs) -> bool:
        """Copy usual inputs into a step; return whether they are usual."""
        robot, readings, units = inputs.robot, inputs.readings, self._units
        if inputs.resume or inputs.points is not None or inputs.payload is not None:
            return False
        if inputs.desired is not None or inputs.moving is not None:
            return False
        try:
            parts: Any = (robot.q, robot.qd, robot.q_commanded, robot.qd_commanded, robot.tau_ext, robot.wrench)
            stamps, distance, status = readings.stamp, readings.distance, readings.status
            if [*map(len, parts)] != self._sizes or not len(stamps) == len(distance) == len(status) == units:
                return False
            if status.dtype is not WHOLE or not (isinstance(inputs.stamp, float) and isinstance(robot.stamp, float)):
                return False
            numbers, whole = now.blocks[0], now.blocks[1]
            np.concatenate(parts, out=numbers[self._joints])
            np.concatenate((stamps, distance), out=numbers[self._readings])
            whole[self._status] = status
            numbers[self._stamps[0]], numbers[self._stamps[1]] = inputs.stamp, robot.stamp
            return True
        except (AttributeError, TypeError, ValueError, OverflowError):
            return False


def time_of(stamp: object) -> float | None:
    """Return a time stamp [s], or None for anything else."""
    try:
        time = real_number(stamp)
    except (TypeError, ValueError, OverflowError):
        return None
    return time if abs(time) < LATEST.limit else None


def sound_robot(robot: RobotState, qd_max: FloatArray) -> tuple[RobotState | None, str]:
    """Copy a robot's state, or say why no arm with these limits (n,) [rad/s] can have it.

    External torques that no arm can have become NaN.
    """
    n = len(qd_max)
    sound, wrong = copy_input(RobotState, robot, n=n)
    if sound is None and "tau_ext" in wrong:
        sound, wrong = copy_input(RobotState, replace(robot, tau_ext=np.full(n, np.nan)), n=n)
    if sound is None:
        return None, wrong
    fast = ~(np.abs(sound.qd_commanded) < FASTEST * qd_max)
    if fast.any():
        number = sound.qd_commanded[fast][0]
        return None, f"RobotState.qd_commanded holds {number:g}, no number below {FASTEST:g} times its limit"
    return sound if below(sound.tau_ext, STRONGEST) else replace(sound, tau_ext=np.full(n, np.nan)), ""


def sound_readings(readings: RangeReadings, units: int) -> tuple[RangeReadings, str]:
    """Copy readings; where they do not fit the number of units, return none and the reason."""
    sound, wrong = copy_input(RangeReadings, readings, K=units)
    if sound is None:
        sound = RangeReadings(np.full(units, -np.inf), np.zeros(units), np.full(units, int(RangeStatus.NONE)))
    return sound, wrong


def sound_touch(touch: TouchReadings | None, units: int) -> tuple[TouchReadings | None, str]:
    """Copy touch readings; where they do not fit the number of units, return none and the reason.

    A stamp of NaN is that of a unit that has not reported yet; a force of NaN or below 0 is not measured. None stays
    None: a skin without touch sensors.
    """
    sound, wrong = (None, "") if touch is None else copy_input(TouchReadings, touch, K=units)
    if sound is not None:
        sound.stamp[np.isnan(sound.stamp)] = -np.inf
        sound.force[~((sound.force >= 0.0) & (sound.force < STRONGEST))] = np.nan
    return sound, wrong


def sound_points(points: SeenPoints | None) -> tuple[SeenPoints | None, str]:
    """Copy points of outside sources; where they cannot be used, return None and the reason.

    A set with more than half of its points implausible cannot be used; single points are left out later.
    """
    sound, wrong = (None, "") if points is None else copy_input(SeenPoints, points)
    if sound is None:
        return None, wrong and f"cannot be used ({wrong})"
    if len(sound.stamp) > MOST_POINTS:
        return None, f"gives {len(sound.stamp)} points, more than {MOST_POINTS}"
    good, none = usable(sound.stamp, sound.point, sound.sigma)
    count = len(sound.stamp) - none
    if 2 * good < count:
        return None, (
            f"gives {count - good} implausible points of {count}: a coordinate of {FARTHEST:g} m or more, or a sigma"
            f" outside 0 to {LARGEST_SIGMA:g} m"
        )
    return sound, ""


def sound_moving(moving: MovingFixtures | None, now: float, longest: float) -> tuple[MovingFixtures | None, str]:
    """Copy moving fixtures; where they cannot be used, return None and the reason.

    Silence is no free space: a body that was reported longer than `longest` [s] before `now` [s] may be anywhere.
    """
    sound, wrong = (None, "") if moving is None else copy_input(MovingFixtures, moving)
    if sound is None or len(sound.radius) == 0:
        return None, wrong and f"cannot be used ({wrong})"
    if (sound.radius < 0.0).any():
        return None, f"have a radius of {sound.radius.min():g} m"
    if sound.stamp == -np.inf:
        return None, "have not been reported yet"
    if not abs(now - sound.stamp) <= longest:
        return None, f"were last reported {now - sound.stamp:.3f} s ago"
    return sound, ""


def sound_payload(payload: Payload | None, most_kg: float) -> tuple[Payload | None, str]:
    """Return an announced payload, or None and the reason; `most_kg` is the load that the arm can hold [kg]."""
    if payload is None or (isinstance(payload, Payload) and payload.mass_kg <= most_kg):
        return payload, ""
    if not isinstance(payload, Payload):
        return None, f"a {type(payload).__name__}, no Payload"
    return None, f"{payload.mass_kg:g} kg, more than the {most_kg:.3g} kg that this arm's joints can hold"


def sound_desired(desired: Desired | None, joints: int, now: float) -> tuple[Desired | None, str]:
    """Copy a desired motion for an arm with a number of joints, or say why it is none."""
    if desired is None:
        return None, ""
    if reason := getattr(desired, "refused", ""):
        return None, str(reason)
    try:
        kind = DesiredKind(desired.kind)
    except (AttributeError, ValueError):
        return None, f"{reprlib.repr(desired)} is of no kind of a Desired"
    sound, wrong = copy_input(Desired, desired, w=_WIDTH.get(kind, joints))
    if sound is None:
        return None, wrong
    stamp, number = sound.stamp, sound.number
    if not 1 <= len(stamp) <= _MOST_INSTANTS:
        return None, f"it has {len(stamp)} instants, not 1 to {_MOST_INSTANTS}"
    if (np.diff(stamp) <= 0.0).any():
        return None, "its stamps do not increase"
    if stamp[0] > now + _AHEAD_S:
        return None, f"it is stamped {stamp[0] - now:.0f} s in the future"
    if kind is DesiredKind.POSE:
        R = number[:, 3:].reshape(-1, 3, 3)
        orthonormal = np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)) < _ROUNDING
        if not (orthonormal.all() and (np.linalg.det(R) > 0.0).all()):
            return None, "its orientation is no rotation"
    return replace(sound, kind=kind), ""
