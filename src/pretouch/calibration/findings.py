"""Findings on a unit whose place is estimated: unobserved directions, and the way it sits on its link."""

import numpy as np

from pretouch.calibration.fit import ACC_SCALE, GYRO_SCALE, PLACE, TURN
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located
from pretouch.calibration.values import (
    LEAST_SWING_RAD,
    SCALE_ERROR,
    TOLERATED_ACCELERATION,
    TOLERATED_ANGULAR_VELOCITY,
    UNUSABLE,
    Remark,
)
from pretouch.robot.model import RobotModel
from pretouch.sensing.unit import seat
from pretouch.types import FloatArray

_POSITION_SIGMA_M = 0.01
"""An answer with a larger standard deviation of its position, in any direction, is refused [m]."""
_ORIENTATION_SIGMA_DEG = 2.0
"""An answer with a larger standard deviation of its orientation, about any axis, is refused [degrees]."""
_UNUSUAL = 5.0
"""Standard deviations, as assumed, from which on an error of a scale is not its own."""
_MANY = 0.05
"""Share of outliers from which on they are worth a word."""
_LONG_S = 0.5
"""Outliers that last for longer, up to the end of the run, are of a unit that is not there [s]."""
_INWARDS = -0.5
"""Cosine between beam and outward normal below which a beam points into the link."""
_DEEPEST = 0.02
"""A unit that is found further inside a capsule [m] cannot be there: capsules are no further off the true surface."""
_CLEAR = 1e-4
"""Height at which a unit that was moved out of a capsule is left [m]."""
_TRIES = 20
_INSIDE, _FACING = 3.0, 0.02
"""Where links are weighed: how much worse being inside is than being off by as much, and how far off a beam along the
surface is worth [m]."""


def share_findings(arm: ArmMotion, located: Located) -> list[Remark]:
    """Say how much of the run was left out, and what of the rest is not explained."""
    whole = float(arm.usable.sum())
    missing, outliers = (1 - located.instants.sum() / whole), float((located.instants & ~located.used).sum()) / whole
    findings = _slipped(arm, located)
    unusable = missing + outliers > UNUSABLE
    if unusable or (outliers > _MANY and not findings):
        sentence = (
            f"During {outliers:.0%} of the run it did not move with its link, and during {missing:.0%} it measured"
            f" nothing or was out of range. That was left out (limit {UNUSABLE:.0%}): check whether it is loose."
        )
        findings.append(Remark("unusable" if unusable else "outliers", sentence, unusable))
    turning, acceleration = float(located.noise[0]), float(located.noise[3])
    if turning > TOLERATED_ANGULAR_VELOCITY or acceleration > TOLERATED_ACCELERATION:
        sentence = (
            f"{turning:.3g} rad/s and {acceleration:.3g} m/s^2 of its measurements are unexplained (limits"
            f" {TOLERATED_ANGULAR_VELOCITY:g} rad/s and {TOLERATED_ACCELERATION:g} m/s^2). Check that it"
            " is fastened, and that scales and axes of both sensors are right."
        )
        findings.append(Remark("unexplained", sentence, True))
    return findings


def _slipped(arm: ArmMotion, located: Located) -> list[Remark]:
    """Say when a unit ceased to move as its link: where it was found, it is no more."""
    last = np.flatnonzero(located.used)[-1]
    if located.instants[last + 1 :].sum() * (arm.time[1] - arm.time[0]) <= _LONG_S:
        return []
    since = arm.time[last] - arm.time[0]
    sentence = (
        f"It slipped, or came off: from {since:.1f} s after the first joint state on, it did not move with its link."
        " Fasten it and calibrate again."
    )
    return [Remark("slipped", sentence, True)]


def scale_findings(located: Located) -> list[Remark]:
    """Name errors of the IMU's scales that are too large to be its own."""
    findings, errors = [], located.estimate.errors
    for sensor, scale in (("accelerometer", errors[ACC_SCALE]), ("gyroscope", errors[GYRO_SCALE])):
        axis = int(np.argmax(np.abs(scale)))
        if abs(scale[axis]) > _UNUSUAL * SCALE_ERROR:
            way_out = "correct its sign" if scale[axis] < -1 else "check its range"
            sentence = (
                f"The scale of its {sensor} {'xyz'[axis]} seems to be {1 + scale[axis]:.2f} instead of 1: {way_out}."
            )
            findings.append(Remark("scale", sentence, True))
    return findings


def unknown_finding(arm: ArmMotion, link: int, T: FloatArray, covariance: FloatArray) -> list[Remark]:
    """Say what of a place, T_link_sensor (4, 4) with its covariance (6, 6), is not known, and what to do."""
    model, moving = arm.model, arm.model.moved_by[link]
    unknown = unknown_directions(covariance, T)
    if not unknown:
        return []
    swing: FloatArray = np.ptp(arm.q[arm.usable], axis=0)
    lazy = np.flatnonzero(moving & (swing < 10 * LEAST_SWING_RAD))
    names = ", ".join(f"{model.joints[j]} (it moved by {np.rad2deg(swing[j]):.1f} degrees)" for j in lazy)
    way_out = (
        "Move for longer, or faster, turn about more axes, and record joint positions with all their digits, each with"
        " its own stamp."
    )
    if len(lazy):
        way_out = f"Move {names} more."
    if moving.sum() == 1:
        (joint,) = np.array(model.joints)[moving]
        way_out = f"{joint} alone moves {model.links[link]}, so no motion can determine it: measure it by hand."
    return [Remark("unobservable", f"Not known: {', and '.join(unknown)}. {way_out}", True)]


def unknown_directions(covariance: FloatArray, T_link_sensor: FloatArray) -> list[str]:
    """Describe the directions of a pose (4, 4) that are less certain than required.

    `covariance` (6, 6) is of the rotation vector in the sensor frame [rad] and the position in the link frame [m].
    """
    R, words = T_link_sensor[:3, :3], []
    turn = R @ covariance[TURN, TURN] @ R.T
    for part, limit, name, factor, unit in (
        (covariance[PLACE, PLACE], _POSITION_SIGMA_M, "its position along", 1e3, "mm"),
        (turn, np.deg2rad(_ORIENTATION_SIGMA_DEG), "its orientation about", np.rad2deg(1.0), "degrees"),
    ):
        variance, vectors = np.linalg.eigh(part)
        for sigma, direction in zip(np.sqrt(np.maximum(variance, 0.0)), vectors.T, strict=True):
            if sigma > limit:
                words.append(f"{name} {_in_words(direction)} of the link (sigma {factor * sigma:.3g} {unit})")
    return words


def _in_words(direction: FloatArray) -> str:
    """Write a direction (3,), as an axis' name where it is one."""
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) > 0.98:
        return "xyz"[largest]
    x, y, z = direction * np.sign(direction[largest])
    return f"({x:.2f}, {y:.2f}, {z:.2f})"


def mounting_findings(model: RobotModel, link: int, T: FloatArray) -> list[Remark]:
    """Say what is odd about where a unit sits and looks, T_link_sensor (4, 4)."""
    below, name = seat(model, link, T[:3, 3]), model.links[link]
    if below is None:
        return []
    findings = []
    if below.height < 0:
        refused = below.height < -_DEEPEST or moved_out(model, link, T[:3, 3]) is None
        way_out = "check its link and the arm's model" if refused else "in the skin file it is moved out, less certain"
        sentence = f"It lies {-1000 * below.height:.1f} mm inside the capsules of {name}: {way_out}."
        findings.append(Remark("inside", sentence, refused))
    facing = float(below.normal @ T[:3, 2])
    if facing < _INWARDS:
        tilt = np.rad2deg(np.arccos(np.clip(facing, -1.0, 1.0)))
        sentence = (
            f"Its beam (z axis) points into {name}, {tilt:.0f} degrees away from outwards: turn the board over, or give"
            " the IMU's data in the axes of the range finder."
        )
        findings.append(Remark("inwards", sentence, True))
    return findings


def likely_member(model: RobotModel, body: tuple[int, ...], link: int, T: FloatArray) -> int:
    """Return the link, of those of a rigid body, on whose surface a unit at T (4, 4) on one of them most likely sits.

    It is the nearest one that the unit looks away from. Links without a capsule are chosen only if none has one.
    """

    def oddity(member: int) -> float:
        """Return the distance in metres."""
        there, _ = seen_from(model, member, link, T, np.eye(6))
        place = seat(model, member, there[:3, 3])
        if place is None:
            return np.inf
        away = place.height if place.height > 0 else -_INSIDE * place.height
        return away + _FACING * (1 - float(place.normal @ there[:3, 2]))

    best = min(body, key=oddity)
    return best if np.isfinite(oddity(best)) else link


def seen_from(model: RobotModel, link: int, other: int, T: FloatArray, C: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return pose (4, 4) and covariance (6, 6) in the frame of `link`, given in that of `other`, to which it is fixed.

    The covariance is of rotation vector in the sensor frame [rad] and position in the link frame [m].
    """
    kin = model.kinematics(model.q_mid)
    R = kin.rotation[link].T @ kin.rotation[other]
    T_link_other = np.eye(4)
    T_link_other[:3, :3] = R
    T_link_other[:3, 3] = kin.rotation[link].T @ (kin.position[other] - kin.position[link])
    turned = np.eye(6)
    turned[3:, 3:] = R
    return T_link_other @ T, turned @ C @ turned.T


def moved_out(model: RobotModel, link: int, p: FloatArray) -> FloatArray | None:
    """Return the point (3,) outside all capsules of a link that p (3,) is moved to; None if there is none near by."""
    at = p
    for _ in range(_TRIES):
        below = seat(model, link, at)
        if below is None or below.height >= 0:
            return at if np.linalg.norm(at - p) <= 2 * _DEEPEST else None
        at = at + (_CLEAR - below.height) * below.normal
    return None
