"""What goes into a control step and comes out of it, to messages and back, to the bit.

Both ways follow annotations: a message has the names of a class's fields, what is optional has a field `has_x` before
it, and an array with rows says so in the message's definition. What is given here is what differs from that.
"""

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from operator import attrgetter
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from pretouch.arrays import real, real_number
from pretouch.desired import Desired, DesiredKind
from pretouch.errors import RecordingError
from pretouch.moving_fixtures import MovingFixtures
from pretouch.payload import Payload
from pretouch.recording.messages import PACKAGE, decoded, encoded, fields_of
from pretouch.recording.truth import Truth
from pretouch.types import (
    BoolArray,
    ControlStep,
    FloatArray,
    Inputs,
    IntArray,
    RangeReadings,
    RobotState,
    SeenPoints,
    Thresholds,
    TouchReadings,
)

INPUTS, STEP, TRUTH = f"{PACKAGE}/msg/Inputs", f"{PACKAGE}/msg/Step", f"{PACKAGE}/msg/Truth"
TOUCH = f"{PACKAGE}/msg/Touch"
POINTS = f"{PACKAGE}/msg/SeenPoints"
PAYLOAD = f"{PACKAGE}/msg/Payload"
DESIRED = f"{PACKAGE}/msg/Desired"
MOVING = f"{PACKAGE}/msg/MovingFixtures"

_NAMED: dict[type, str] = {ControlStep: "Step", TouchReadings: "Touch"}
"""Messages that are not named as the classes of which they hold the fields."""
_SENSIBLE_S = 1e12
"""A time stamp from here on [s] is shown in a sentence, as it was given."""
_SHOWN = 500
"""Characters of what cannot be put in a message that are kept."""


class UnreadableError(Exception):
    """A part of the inputs fits no message."""


@cache
def hints_of(kind: type) -> tuple[tuple[str, Any], ...]:
    """Return names and annotations of the fields of a dataclass or named tuple, in order."""
    hints = get_type_hints(kind)
    return tuple((name, hints[name]) for name in (getattr(kind, "_fields", None) or [f.name for f in fields(kind)]))


def optional(hint: Any) -> Any:
    """Return what an annotation allows beside None; None if it does not allow that."""
    if get_origin(hint) not in (Union, UnionType):
        return None
    (left,) = (inner for inner in get_args(hint) if inner is not NoneType)
    return left


@cache
def _made_of(kind: type) -> Callable[[Any], Any]:
    """Return what makes a value of a class from a message."""
    defined = {field.name: field for field in fields_of(f"{PACKAGE}/msg/{_NAMED.get(kind, kind.__name__)}")}
    if kind is Thresholds:
        parts_of = attrgetter(*defined)
        return lambda message: Thresholds(np.array(parts_of(message)))
    ways = tuple(_field_of(name, hint, defined[name].shape) for name, hint in hints_of(kind))
    return lambda message: kind(*[way(message) for way in ways])


def _field_of(name: str, hint: Any, shape: tuple[int, ...]) -> Callable[[Any], Any]:
    """Return what makes a field of a class from a message, where arrays of more dimensions lie row by row."""
    get, left = attrgetter(name), optional(hint)
    if left is not None:
        there, made = attrgetter(f"has_{name}"), _field_of(name, left, shape)
        return lambda message: made(message) if there(message) else None
    if shape:
        return lambda message: get(message).reshape(-1, *shape)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return lambda message: hint(get(message))
    if is_dataclass(hint):
        inner = _made_of(hint)  # type: ignore[arg-type]
        return lambda message: inner(get(message))
    return get


def _made(kind: type, message: Any) -> Any:
    """Return a value of a class from a message; one that cannot be is a RecordingError."""
    try:
        return _made_of(kind)(message)
    except ValueError as error:
        raise RecordingError(f"A {kind.__name__} in the recording cannot be read: {error}") from error


def _number(given: Any) -> float:
    """Return a time stamp, if as a float it is the same to the controller."""
    number = real_number(given)
    if not isinstance(given, float) and not abs(number) < _SENSIBLE_S:
        raise UnreadableError("a time stamp is none")
    return number


def _numbers(given: Any) -> FloatArray:
    """Return an array of float64 (k,), if that is the same to the controller."""
    array = np.asarray(given)
    if array.ndim != 1 or array.dtype.kind not in "fiub":
        raise UnreadableError("what should be a row of numbers is none")
    return np.ascontiguousarray(real(array, copy=False))


def _wholes(given: Any) -> IntArray:
    array = np.array(given)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise UnreadableError("statuses are no row of whole numbers")
    return array.astype(np.int64)


def _truths(given: Any) -> BoolArray:
    array = np.array(given)
    if array.ndim != 1 or array.dtype.kind not in "biu":
        raise UnreadableError("contacts are no row of truths")
    return np.asarray(array != 0)


def _torques(given: Any) -> FloatArray | None:
    try:
        return _numbers(given)
    except (UnreadableError, ValueError):
        return None  # such are no torques to a step either


def _points(given: Any) -> FloatArray:
    points = np.asarray(given)
    if points.ndim != 2 or points.shape[1] != 3:
        raise UnreadableError("points are no rows of three numbers")
    return _numbers(points.reshape(-1)).reshape(-1, 3)


_USUAL: dict[Any, Callable[[Any], Any]] = {
    float: _number, FloatArray: _numbers, IntArray: _wholes, BoolArray: _truths,
    FloatArray | None: lambda given: None if given is None else _numbers(given),
}  # fmt: skip
_OTHERWISE: dict[tuple[type, str], Callable[[Any], Any]] = {
    (RobotState, "tau_ext"): _torques,
    (SeenPoints, "point"): _points,
    **{(MovingFixtures, name): _points for name in ("a", "b", "a_velocity", "b_velocity")},
}


@cache
def _ways_to_take(kind: type) -> tuple[tuple[Callable[[Any], Any], Callable[[Any], Any]], ...]:
    return tuple((_OTHERWISE.get((kind, name)) or _USUAL[hint], attrgetter(name)) for name, hint in hints_of(kind))


def _taken(kind: type, given: Any) -> Any:
    """Return inputs as the controller takes them; raises for what it could not use."""
    return kind(*[take(get(given)) for take, get in _ways_to_take(kind)])


def encode_inputs(sequence: int, inputs: Inputs) -> tuple[bytes, bool]:
    """Return inputs as CDR, and whether all a step goes by is in it; if not, it says what was given instead."""
    try:
        stamp, robot = _number(inputs.stamp), _taken(RobotState, inputs.robot)
        readings, resume = _taken(RangeReadings, inputs.readings), bool(inputs.resume)
        others = (TouchReadings, inputs.touch), (SeenPoints, inputs.points), (MovingFixtures, inputs.moving)
        for kind, own in others:
            if own is not None:
                _taken(kind, own)  # has a message of its own
        if not isinstance(inputs.payload, Payload | None):
            raise UnreadableError("the payload is none")
        encode_desired(sequence, inputs)
        given = {"stamp": stamp, "robot": robot, "readings": readings, "resume": resume, "unreadable": ""}
        return encoded(INPUTS, None, sequence=sequence, **given), True
    except Exception as error:  # inputs may be anything, with any behaviour
        given = {"stamp": 0.0, "robot": None, "readings": None, "resume": False, "unreadable": _shown(inputs, error)}
        return encoded(INPUTS, None, sequence=sequence, **given), False


def _shown(inputs: object, error: Exception) -> str:
    """Describe inputs that cannot be kept, in one line of limited length."""
    try:
        return f"{error}: {inputs!r}"[:_SHOWN]
    except Exception:  # a repr may do anything
        return f"{error}: a {type(inputs).__name__}"[:_SHOWN]


def decode_inputs(data: bytes) -> tuple[int, Inputs | None, str]:
    """Return the number of a step, what it was given, and, where that was not kept, what is known of it."""
    m = decoded(INPUTS, data)
    if m.unreadable:
        return m.sequence, None, m.unreadable
    robot, readings = _made(RobotState, m.robot), _made(RangeReadings, m.readings)
    return m.sequence, Inputs(m.stamp, robot, readings, m.resume), ""


def encode_touch(sequence: int, inputs: Inputs) -> bytes | None:
    """Return what units said of a touch as CDR, of inputs that `encode_inputs` found to be whole; None for nothing."""
    if inputs.touch is None:
        return None
    return encoded(TOUCH, _taken(TouchReadings, inputs.touch), sequence=sequence, step_stamp=_number(inputs.stamp))


def decode_touch(data: bytes) -> TouchReadings:
    """Return what units said of a touch."""
    return _made(TouchReadings, decoded(TOUCH, data))


def encode_moving(sequence: int, inputs: Inputs) -> bytes | None:
    """Return what was known to move beside the arm as CDR, of whole inputs; None for nothing."""
    if inputs.moving is None:
        return None
    return encoded(MOVING, _taken(MovingFixtures, inputs.moving), sequence=sequence, step_stamp=_number(inputs.stamp))


def decode_moving(data: bytes) -> MovingFixtures:
    """Return what was known to move beside the arm."""
    return _made(MovingFixtures, decoded(MOVING, data))


def encode_payload(sequence: int, inputs: Inputs) -> bytes | None:
    """Return an announced load as CDR, of inputs that `encode_inputs` found to be whole; None for nothing."""
    if inputs.payload is None:
        return None
    com_m = np.array(inputs.payload.com_m)
    return encoded(PAYLOAD, inputs.payload, sequence=sequence, step_stamp=_number(inputs.stamp), com_m=com_m)


def decode_payload(data: bytes) -> Payload:
    """Return an announced load."""
    m = decoded(PAYLOAD, data)
    return Payload(m.mass_kg, tuple(m.com_m), m.within_s)


def encode_desired(sequence: int, inputs: Inputs) -> bytes | None:
    """Return a desired motion as CDR; None for nothing. Raises for what no step could use."""
    if inputs.desired is None:
        return None
    kind, stamp = DesiredKind(inputs.desired.kind), _numbers(inputs.desired.stamp)
    rows = np.asarray(inputs.desired.number)
    if rows.ndim != 2 or len(rows) != len(stamp) or not rows.size:
        raise UnreadableError("the desired motion has not one row a stamp")
    numbers = _numbers(rows.reshape(-1))
    given = {"quantity": int(kind), "stamp": stamp, "number": numbers, "refused": str(inputs.desired.refused)}
    return encoded(DESIRED, None, sequence=sequence, step_stamp=_number(inputs.stamp), **given)


def decode_desired(data: bytes) -> Desired:
    """Return a desired motion."""
    m = decoded(DESIRED, data)
    try:
        return Desired(DesiredKind(m.quantity), m.stamp, m.number.reshape(len(m.stamp), -1), m.refused)
    except ValueError as error:
        raise RecordingError(
            f"A desired motion in it cannot be read ({error}): use a recording that is whole."
        ) from error


def encode_points(sequence: int, points: SeenPoints, same_as: int) -> bytes:
    """Return points of outside sources as CDR; where they are the same as those of an earlier step, only its number."""
    if same_as == sequence:
        return encoded(POINTS, _taken(SeenPoints, points), sequence=sequence, same_as=same_as)
    return encoded(POINTS, SeenPoints(0.0, *[None] * 3), sequence=sequence, same_as=same_as)  # type: ignore[arg-type]


def decode_points(data: bytes) -> tuple[int, SeenPoints]:
    """Return the number of the step whose message holds the points, and those in this one."""
    m = decoded(POINTS, data)
    return m.same_as, _made(SeenPoints, m)


def encode_step(sequence: int, step: ControlStep, tangent: FloatArray | None = None) -> bytes:
    """Return a step as CDR, with the path's unit tangent (3,) where the path can only be kept so."""
    return encoded(STEP, step, sequence=sequence, path_tangent=tangent)


def decode_step(data: bytes) -> tuple[int, ControlStep, FloatArray]:
    """Return the number of a step, the step, and the path's tangent there, (0,) unless it was kept."""
    m = decoded(STEP, data)
    return m.sequence, _made(ControlStep, m), m.path_tangent


def encode_truth(sequence: int, truth: Truth) -> bytes:
    """Return what a simulation knows as CDR."""
    times, links, velocities = zip(*truth.touches, strict=True) if truth.touches else ((), (), ())
    return encoded(
        TRUTH, truth, sequence=sequence, touch_time=np.array(times, dtype=np.float64),
        touch_link=np.array(links, dtype=np.int64), touch_velocity=np.array(velocities, dtype=np.float64),
    )  # fmt: skip


def decode_truth(data: bytes) -> tuple[int, Truth]:
    """Return the number of a step and what the simulation knew."""
    m = decoded(TRUTH, data)
    velocities = m.touch_velocity.reshape(-1, 3)
    touches = tuple(zip(m.touch_time.tolist(), m.touch_link.tolist(), velocities, strict=True))
    return m.sequence, Truth(m.time, m.force.reshape(-1, 3), m.hand, touches)
