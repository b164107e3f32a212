"""Inputs as arrays of known types and shapes, or what keeps them from being that."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.desired import LARGEST, LATEST
from pretouch.perception.external_points import FARTHEST, LARGEST_SIGMA, usable
from pretouch.robot.kinematics import below
from pretouch.types import WHOLE, FloatArray, Payload, RangeReadings, RangeStatus, RobotState, SeenPoints, TouchReadings
from pretouch.values import real, real_number

FASTEST = 2.0
"""Times the arm's limit: a commanded joint velocity from here on is none that any arm was ever given."""

STRONGEST = 1e4
"""An external torque [Nm] from here on is none."""

MOST_POINTS = 20_000
"""Points of outside sources that are taken in one step: what they cost stays bounded."""

_PARTS = ("joint positions", "joint velocities", "commanded joint positions", "commanded joint velocities")


def time_of(stamp: float) -> float | None:
    """Return a time stamp, or None if it is none."""
    try:
        time = real_number(stamp)
    except (TypeError, ValueError, OverflowError):
        return None
    return time if abs(time) < LATEST else None


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
        bounds = np.vstack([np.full((3, n), LARGEST), FASTEST * qd_max])
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
            if not abs(numbers[i, j]) < LARGEST:
                return False
        if not abs(numbers[3, j]) < FASTEST * qd_max[j]:
            return False
    if not below(numbers[4], STRONGEST):
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
    nothing = RangeReadings(np.full(units, -np.inf), np.zeros(units), np.full(units, int(RangeStatus.NONE)))
    try:
        stamp, distance, status = real(readings.stamp), real(readings.distance), np.array(readings.status)
    except AttributeError:
        return nothing, f"they are {readings!r}"
    except (TypeError, ValueError, OverflowError):
        return nothing, "they are not arrays of numbers"
    if not stamp.shape == distance.shape == status.shape == (units,):
        shapes = f"{stamp.shape}, {distance.shape} and {status.shape}"
        return nothing, f"stamps, distances and statuses have the shapes {shapes}, not ({units},)"
    if status.dtype is not WHOLE:
        if status.dtype.kind not in "iu":
            return nothing, f"statuses are of type {status.dtype}, not whole numbers"
        status = status.astype(np.int64)
    return RangeReadings(stamp, distance, status), ""


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
    force[~((force >= 0.0) & (force < STRONGEST))] = np.nan
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


def sound_payload(payload: Payload | None, most_kg: float) -> tuple[Payload | None, str]:
    """Return an announced payload, or None and what is wrong with it for an arm that can hold so much [kg]."""
    if payload is None or (isinstance(payload, Payload) and payload.mass_kg <= most_kg):
        return payload, ""
    if not isinstance(payload, Payload):
        return None, f"a {type(payload).__name__}, no Payload"
    return None, f"{payload.mass_kg:g} kg, more than the {most_kg:.3g} kg that this arm's joints can hold"
