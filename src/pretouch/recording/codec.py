"""What goes into a control step and comes out of it, to messages and back, to the bit."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pretouch.errors import RecordingError
from pretouch.recording.messages import PACKAGE, decoded, encoded, make, plain_text
from pretouch.recording.truth import Truth
from pretouch.types import (
    BoolArray,
    Contact,
    ControlStep,
    FloatArray,
    ImuReadings,
    Inputs,
    IntArray,
    Mode,
    Obstacles,
    QpOutcome,
    QpSolution,
    RangeReadings,
    RobotState,
    SeenPoints,
    Thresholds,
    Touched,
    TouchReadings,
)

INPUTS, STEP, TRUTH = f"{PACKAGE}/msg/Inputs", f"{PACKAGE}/msg/Step", f"{PACKAGE}/msg/Truth"
TOUCH = f"{PACKAGE}/msg/Touch"
IMU = f"{PACKAGE}/msg/ImuReadings"
POINTS = f"{PACKAGE}/msg/SeenPoints"
_ROBOT, _READINGS = f"{PACKAGE}/msg/RobotState", f"{PACKAGE}/msg/RangeReadings"
_OBSTACLES, _THRESHOLDS = f"{PACKAGE}/msg/Obstacles", f"{PACKAGE}/msg/Thresholds"
_CONTACT, _QP = f"{PACKAGE}/msg/Contact", f"{PACKAGE}/msg/QpSolution"
_TOUCHED = f"{PACKAGE}/msg/Touched"

_NONE = np.zeros(0)
_NO_WHOLE = np.zeros(0, dtype=np.int64)
_NO_PLACES = bytes(20)
"""Lengths of the five empty rows of places that are touched: steps recorded by versions without them end before."""
_SENSIBLE_S = 1e12
"""A time stamp from here on [s] is shown in a sentence, as it was given."""
_SHOWN = 500
"""Characters of what cannot be put in a message that are kept."""


class UnreadableError(Exception):
    """A part of the inputs fits no message."""


def encode_inputs(sequence: int, inputs: Inputs) -> tuple[bytes, bool]:
    """Return inputs as CDR, and whether all a step goes by is in it; if not, it says what was given instead."""
    try:
        fields = (_number(inputs.stamp), _robot(inputs.robot), _readings(inputs.readings), bool(inputs.resume))
        if inputs.touch is not None:
            _touch(inputs.touch)  # has a message of its own
        if inputs.points is not None:
            _points(inputs.points)
        return encoded(INPUTS, make(INPUTS, sequence, *fields, "")), True
    except Exception as error:  # inputs may be anything, with any behaviour
        nothing = make(_ROBOT, 0.0, _NONE, _NONE, _NONE, _NONE, _NONE, False, _NONE)
        silent = make(_READINGS, _NONE, _NONE, _NO_WHOLE)
        text = plain_text(_shown(inputs, error))
        return encoded(INPUTS, make(INPUTS, sequence, 0.0, nothing, silent, False, text)), False


def _shown(inputs: object, error: Exception) -> str:
    """Describe inputs that cannot be kept, in one line of limited length."""
    try:
        return f"{error}: {inputs!r}"[:_SHOWN]
    except Exception:  # a repr may do anything
        return f"{error}: a {type(inputs).__name__}"[:_SHOWN]


def _number(given: Any) -> float:
    """Return a time stamp, if as a float it is the same to the controller."""
    number = float(given)
    if not isinstance(given, float) and not abs(number) < _SENSIBLE_S:
        raise UnreadableError("a time stamp is none")
    return number


def _numbers(given: Any) -> FloatArray:
    """Return an array of float64 (k,), if that is the same to the controller."""
    array = np.asarray(given)
    if array.ndim != 1 or array.dtype.kind not in "fiub":
        raise UnreadableError("what should be a row of numbers is none")
    return np.ascontiguousarray(array, dtype=np.float64)


def _wholes(given: Any) -> IntArray:
    array = np.array(given)
    if array.ndim != 1 or array.dtype.kind not in "iu":
        raise UnreadableError("statuses are no row of whole numbers")
    return array.astype(np.int64)


def _robot(robot: RobotState) -> Any:
    try:
        tau_ext = _numbers(robot.tau_ext)
    except (UnreadableError, ValueError):
        tau_ext = _NONE  # such are no torques to a step either
    wrench = None if robot.wrench is None else _numbers(robot.wrench)
    return make(
        _ROBOT, _number(robot.stamp), _numbers(robot.q), _numbers(robot.qd), _numbers(robot.q_commanded),
        _numbers(robot.qd_commanded), tau_ext, wrench is not None, _NONE if wrench is None else wrench,
    )  # fmt: skip


def _readings(readings: RangeReadings) -> Any:
    return make(_READINGS, _numbers(readings.stamp), _numbers(readings.distance), _wholes(readings.status))


def _points(points: SeenPoints) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Return points of outside sources as they are kept, if they are such to the controller."""
    point = np.asarray(points.point)
    if point.ndim != 2 or point.shape[1] != 3:
        raise UnreadableError("points are no rows of three numbers")
    return _number(points.heard), _numbers(points.stamp), _numbers(point.reshape(-1)), _numbers(points.sigma)


def encode_points(sequence: int, points: SeenPoints, same_as: int) -> bytes:
    """Return points of outside sources as CDR; where they are the same as those of an earlier step, only its number."""
    kept = _points(points) if same_as == sequence else (0.0, _NONE, _NONE, _NONE)
    return encoded(POINTS, make(POINTS, sequence, same_as, *kept))


def decode_points(data: bytes) -> tuple[int, SeenPoints]:
    """Return the number of the step whose message holds the points, and those in this one."""
    m = decoded(POINTS, data)
    return m.same_as, SeenPoints(m.heard, m.stamp, m.point.reshape(-1, 3), m.sigma)


def decode_inputs(data: bytes) -> tuple[int, Inputs | None, str]:
    """Return the number of a step, what it was given, and, where that was not kept, what is known of it."""
    m = decoded(INPUTS, data)
    if m.unreadable:
        return m.sequence, None, m.unreadable
    r, s = m.robot, m.readings
    robot = RobotState(r.stamp, r.q, r.qd, r.q_commanded, r.qd_commanded, r.tau_ext, r.wrench if r.has_wrench else None)
    return m.sequence, Inputs(m.stamp, robot, RangeReadings(s.stamp, s.distance, s.status), m.resume), ""


def encode_imu(sequence: int, time: float, imu: ImuReadings) -> bytes | None:
    """Return IMU samples as CDR; None for what are none to a step either (`faults.sound_imu`)."""
    try:
        unit, stamp = np.array(imu.unit), np.array(imu.stamp, dtype=np.float64)
        parts = [np.array(part, dtype=np.float64) for part in (imu.acceleration, imu.angular_velocity)]
    except (AttributeError, TypeError, ValueError, OverflowError):
        return None
    if unit.dtype.kind not in "iu" or unit.ndim != 1 or unit.shape != stamp.shape:
        return None
    if any(part.shape != (*stamp.shape, 3) for part in parts):
        return None
    return encoded(IMU, make(IMU, sequence, time, unit.astype(np.int64), stamp, *map(_flat, parts)))


def decode_imu(data: bytes) -> ImuReadings:
    """Return the IMU samples of a step."""
    m = decoded(IMU, data)
    try:
        return ImuReadings(m.unit, m.stamp, m.acceleration.reshape(-1, 3), m.angular_velocity.reshape(-1, 3))
    except ValueError as error:
        raise RecordingError(f"IMU samples in the recording cannot be read: {error}") from error


def encode_step(sequence: int, step: ControlStep, tangent: FloatArray | None = None) -> bytes:
    """Return a step as CDR, with the path's unit tangent (3,) where the path can only be kept so."""
    o, qp, contact, touched = step.obstacles, step.qp, step.contact, step.touched
    obstacles = make(
        _OBSTACLES, o.unit, _flat(o.point), o.ee_distance, _flat(o.body_point), o.link, _flat(o.direction),
        o.body_distance, o.closing_speed,
    )  # fmt: skip
    felt = make(_CONTACT, np.zeros(3), np.zeros(3, np.bool_)) if contact is None else make(
        _CONTACT, contact.force, contact.axes
    )  # fmt: skip
    return encoded(STEP, make(
        STEP, sequence, step.stamp, step.mode.value, plain_text(step.reason), step.q, step.q_commanded,
        _row(step.ee_position), _row(step.ee_velocity), _row(step.path_position), step.path_phase,
        _NONE if tangent is None else tangent, _row(step.desired_velocity), step.speed_scale, step.range_distance,
        obstacles, _row(step.force), _row(step.filtered_force),
        make(_THRESHOLDS, *np.ascontiguousarray(step.thresholds.parts)), step.armed, contact is not None, felt,
        _row(step.reaction_velocity), step.restricted, step.approach_limit,
        make(_QP, qp.qd, qp.slack, qp.multipliers, qp.outcome.value, plain_text(qp.status)), step.command,
        step.residual, step.evidence,
        make(_TOUCHED, touched.link, _flat(touched.point), _flat(touched.force), touched.sigma, touched.probability),
    ))  # fmt: skip


def decode_step(data: bytes) -> tuple[int, ControlStep, FloatArray]:
    """Return the number of a step, the step, and the path's tangent there, (0,) unless it was kept."""
    try:
        m = decoded(STEP, data)
    except RecordingError:
        m = decoded(STEP, data + _NO_PLACES)
    try:
        return m.sequence, _step(m), m.path_tangent
    except ValueError as error:
        raise RecordingError(f"A step in the recording cannot be read: {error}") from error


def _step(m: Any) -> ControlStep:
    o, qp, t = m.obstacles, m.qp, m.thresholds
    parts = np.array((t.upper, t.lower, t.mean, t.sigma, t.obstacle_positive, t.obstacle_negative))
    return ControlStep(
        stamp=m.stamp, mode=Mode(m.mode), reason=m.reason, q=m.q, q_commanded=m.q_commanded,
        ee_position=m.ee_position, ee_velocity=m.ee_velocity, path_position=m.path_position, path_phase=m.path_phase,
        desired_velocity=m.desired_velocity, speed_scale=m.speed_scale, range_distance=m.range_distance,
        obstacles=Obstacles(
            o.unit, o.point.reshape(-1, 3), o.ee_distance, o.body_point.reshape(-1, 3), o.link,
            o.direction.reshape(-1, 3), o.body_distance, o.closing_speed,
        ),
        force=m.force, filtered_force=m.filtered_force, thresholds=Thresholds(parts), armed=m.armed,
        contact=Contact(m.contact.force, m.contact.axes) if m.has_contact else None,
        reaction_velocity=m.reaction_velocity, restricted=m.restricted, approach_limit=m.approach_limit,
        qp=QpSolution(qp.qd, qp.slack, qp.multipliers, QpOutcome(qp.outcome), qp.status), command=m.command,
        residual=m.residual, evidence=m.evidence,
        touched=Touched(
            m.touched.link, m.touched.point.reshape(-1, 3), m.touched.force.reshape(-1, 3), m.touched.sigma,
            m.touched.probability,
        ),
    )  # fmt: skip


def encode_touch(sequence: int, inputs: Inputs) -> bytes | None:
    """Return what units said of a touch as CDR, of inputs that `encode_inputs` found to be whole; None for nothing."""
    if inputs.touch is None:
        return None
    return encoded(TOUCH, make(TOUCH, sequence, _number(inputs.stamp), *_touch(inputs.touch)))


def _touch(touch: TouchReadings) -> tuple[FloatArray, BoolArray, FloatArray, IntArray]:
    contact = np.array(touch.contact)
    if contact.ndim != 1 or contact.dtype.kind not in "biu":
        raise UnreadableError("contacts are no row of truths")
    return _numbers(touch.stamp), contact != 0, _numbers(touch.force), _wholes(touch.status)


def decode_touch(data: bytes) -> TouchReadings:
    """Return what units said of a touch."""
    m = decoded(TOUCH, data)
    return TouchReadings(m.stamp, m.contact, m.force, m.status)


def encode_truth(sequence: int, truth: Truth) -> bytes:
    """Return what a simulation knows as CDR."""
    times, links, velocities = zip(*truth.touches, strict=True) if truth.touches else ((), (), ())
    return encoded(TRUTH, make(
        TRUTH, sequence, _float64(truth.time), _flat(_float64(truth.force)), _row(_float64(truth.hand)),
        np.array(times, dtype=np.float64), np.array(links, dtype=np.int64),
        np.array(velocities, dtype=np.float64).reshape(-1),
    ))  # fmt: skip


def decode_truth(data: bytes) -> tuple[int, Truth]:
    """Return the number of a step and what the simulation knew."""
    m = decoded(TRUTH, data)
    velocities = m.touch_velocity.reshape(-1, 3)
    touches = tuple(zip(m.touch_time.tolist(), m.touch_link.tolist(), velocities, strict=True))
    return m.sequence, Truth(m.time, m.force.reshape(-1, 3), m.hand, touches)


def _float64(given: FloatArray) -> FloatArray:
    return np.asarray(given, dtype=np.float64)


def _flat(array: NDArray[Any]) -> NDArray[Any]:
    return array.reshape(-1)


def _row(array: FloatArray) -> FloatArray:
    return np.ascontiguousarray(array)
