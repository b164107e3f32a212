"""Checks of the joints' and the units' measurements, before they are compared with any link."""

from dataclasses import replace

import numpy as np

from pretouch.calibration.signals import gaps, saturated
from pretouch.calibration.values import (
    CUTOFF_HZ,
    GRAVITY,
    LEAST_SWING_RAD,
    LONGEST_GAP_S,
    SHORTEST_S,
    UNUSABLE,
    Remark,
    UnitData,
)
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.traces import ImuTrace, JointTrace
from pretouch.types import BoolArray, FloatArray

_BEYOND = 0.2
"""How far beyond its limits no joint is ever measured [rad]."""
_BUNCHED = 0.5
"""Share of the mean period within which two states have nearly the same stamp: nothing is interpolated over so little
time but the error of the stamps."""
_FEW = 0.1
"""Share of states with the stamp of another one from which on they come in batches."""
_REGULAR = 0.8
"""Share of the longest gap that joint states may be apart, so that a little jitter makes no gaps."""
_SPARSE = 0.01
"""Share of the run below which joint states that are known are not all of one clock."""
_STUCK_S = 1.0
"""A value that stays the same for longer, while others vary, does not come from a sensor that works [s]."""
_VARIES = np.repeat((0.05, 0.3), 3)
"""By how much others vary then at least: angular velocities [rad/s], accelerations [m/s^2]."""
_AXES = tuple(f"{sensor} {axis}" for sensor in ("gyroscope", "accelerometer") for axis in "xyz")
_MISTAKEN = {
    "accelerometer": (1 / GRAVITY, "m/s^2 is needed and these look like g: multiply by 9.80665"),
    "gyroscope": (np.rad2deg(1.0), "rad/s is needed and these look like degrees/s: multiply by pi / 180"),
}


def mistaken(sensor: str, scale: float) -> str:
    """Say what mistake makes a sensor measure so many times what is right, and the way out."""
    factor, cause = _MISTAKEN[sensor]
    return cause if abs(scale / factor - 1) < 0.1 else "check its units, range and axes"


def checked_joints(model: RobotModel, joints: JointTrace) -> tuple[JointTrace, tuple[Remark, ...]]:
    """Return joint positions at increasing instants, and what is to be known of them.

    Joints that did not move are at rest in them: their noise would pass for a motion. Raises CalibrationError for what
    nothing can be made from.
    """
    stamp, q = np.asarray(joints.stamp, dtype=np.float64), np.asarray(joints.q, dtype=np.float64)
    if stamp.ndim != 1 or q.shape != (len(stamp), model.n):
        raise CalibrationError(
            f"Joint positions have the shape {q.shape} at {stamp.shape} stamps: give one row for each stamp, of the"
            f" {model.n} joints of {model.description.name}."
        )
    finite = np.isfinite(stamp) & np.isfinite(q).all(axis=1)
    clean = JointTrace(stamp[finite], q[finite])
    _check_order(clean.stamp)
    _check_range(model, clean.q)
    for choice in (_own_stamp, _spaced, _renewed):
        clean = clean.at(choice(clean))
    _check_rate(clean)
    findings = []
    if len(clean.stamp) < len(stamp):
        sentence = (
            f"{len(stamp) - len(clean.stamp)} joint states of {len(stamp)} are not finite, repeat the values of the one"
            " before, or have nearly the stamp of the next one, and were left out: record each measurement once,"
            " stamped where it is measured."
        )
        findings.append(Remark("joints_left_out", sentence, False))
    long = np.diff(gaps(clean.stamp, LONGEST_GAP_S)[1:-1], axis=1)
    if len(long):
        sentence = (
            f"Gaps in the joint states: {len(long)}, {long.sum():.2f} s in all. Samples of units around them were left"
            " out: record all states."
        )
        findings.append(Remark("joints_missing", sentence, False))
    moved = _moved(clean.q)
    if not moved.all():
        sentence = (
            f"{', '.join(np.array(model.joints)[~moved])} did not move, so the links on either side cannot be"
            " distinguished, and units beyond are located less well. Move every joint."
        )
        findings.append(Remark("joints_stood", sentence, False))
    return JointTrace(clean.stamp, np.where(moved, clean.q, np.median(clean.q, axis=0))), tuple(findings)


def _check_order(stamp: FloatArray) -> None:
    back = np.flatnonzero(np.diff(stamp) < 0)
    if len(back):
        i = int(back[0])
        raise CalibrationError(
            f"The stamps of the joint states go back, first from {stamp[i]:.6f} s to {stamp[i + 1]:.6f} s at state"
            f" {i + 1}: give them in the order in which they were measured, on one clock."
        )


def _check_range(model: RobotModel, q: FloatArray) -> None:
    beyond = np.maximum(model.q_min - q, q - model.q_max)
    if (beyond > _BEYOND).any():
        i, j = np.unravel_index(int(np.argmax(beyond)), q.shape)
        raise CalibrationError(
            f"{model.joints[j]} is at {q[i, j]:.4g} rad, outside its range from {model.q_min[j]:.4g} to"
            f" {model.q_max[j]:.4g}: give radians, in the order of the arm's joints, of this arm."
        )


def _own_stamp(joints: JointTrace) -> BoolArray:
    """Tell which states (T,) have a stamp of their own; where more than a few have none, they came in batches."""
    _, which, count = np.unique(joints.stamp, return_inverse=True, return_counts=True)
    shared = count[which] > 1
    return np.asarray(~shared | (shared.sum() > _FEW * len(shared)))


def _spaced(joints: JointTrace) -> BoolArray:
    """Tell which states (T,) no other follows closely: stamped on receipt, the last is the least late."""
    stamp, steps = joints.stamp, np.diff(joints.stamp)
    regular = steps[steps <= LONGEST_GAP_S]
    nearest, following = _BUNCHED * float(regular.mean()) if len(regular) else 0.0, np.inf
    keep = np.ones(len(stamp), np.bool_)
    for i in range(len(stamp) - 1, -1, -1):
        keep[i] = following - stamp[i] >= nearest
        following = stamp[i] if keep[i] else following
    return keep


def _renewed(joints: JointTrace) -> BoolArray:
    """Tell which states (T,) are not of a value that was only held until the next one came; an arm may stand longer."""
    first = np.flatnonzero(_changed(joints.q))
    lasts = np.append(np.diff(joints.stamp[first]), np.inf)[: len(first)]
    long = np.repeat(lasts > LONGEST_GAP_S, np.diff(np.append(first, len(joints.q))))
    return np.asarray(_changed(joints.q) | long)


def _changed(q: FloatArray) -> BoolArray:
    """Tell at which states (T,) any position differs from that before; at the first, yes."""
    return np.asarray(np.append(True, (np.diff(q, axis=0) != 0).any(axis=1))[: len(q)])


def _check_rate(joints: JointTrace) -> None:
    """Refuse too few states, and changes of them that are too far apart."""
    steps, rate = np.diff(joints.stamp), 1.0 / (_REGULAR * LONGEST_GAP_S)
    span, covered = float(steps.sum()), float(steps[steps <= LONGEST_GAP_S].sum())
    news = np.diff(joints.stamp[_changed(joints.q)])
    period = float(np.median(news)) if len(news) else 0.0
    if covered < max(SHORTEST_S, _SPARSE * span) or period > 1.05 / rate:
        raise CalibrationError(
            f"{len(joints.stamp)} joint states in {span:.3g} s make up {covered:.3g} s without gaps, with new positions"
            f" every {period:.3g} s: at least {SHORTEST_S:g} s at {rate:g} Hz are needed; record 60 s at 100 Hz"
            " or more, on one clock, in seconds."
        )


def _moved(q: FloatArray) -> BoolArray:
    """Tell which joints moved (n,). CalibrationError if none did."""
    low, high = np.percentile(q, (1.0, 99.0), axis=0)
    moved: BoolArray = high - low > LEAST_SWING_RAD
    if not moved.any():
        raise CalibrationError(
            f"The arm did not move: no joint by more than {np.rad2deg((high - low).max()):.2g} degrees; run a"
            " calibration motion while units and joints are recorded."
        )
    return moved


def checked_unit(unit: UnitData) -> tuple[UnitData, list[Remark]]:
    """Return a unit's data at increasing instants, and what is wrong with it; what is refused cannot be used at all."""
    imu, findings = unit.imu, []
    values = np.column_stack([imu.stamp, imu.acceleration, imu.angular_velocity])
    finite = np.asarray(np.isfinite(values).all(axis=1))
    latest = np.maximum.accumulate(np.where(finite, imu.stamp, -np.inf))
    keep = finite & (imu.stamp > np.concatenate([[-np.inf], latest])[: len(finite)])
    clean = replace(unit, imu=ImuTrace(imu.stamp[keep], imu.acceleration[keep], imu.angular_velocity[keep]))
    if not keep.all():
        sentence = (
            f"{np.mean(~keep):.1%} of its samples are not finite, or not later than those before, and were left out:"
            " check their source, and whether the unit restarted."
        )
        findings.append(Remark("left_out", sentence, bool(np.mean(~keep) > UNUSABLE)))
    span, rate = float(np.ptp(clean.imu.stamp)) if keep.any() else 0.0, 4.0 * CUTOFF_HZ
    if span < SHORTEST_S or keep.sum() < (1.0 - UNUSABLE) * rate * span:
        sentence = (
            f"It has {keep.sum()} samples in {span:.3g} s: at least {SHORTEST_S:g} s at {rate:g} Hz are needed,"
            " of one run. Check that it is switched on and has an IMU, and its connection."
        )
        findings.append(Remark("too_little", sentence, True))
    if not any(finding.refused for finding in findings):
        cut = saturated(clean)
        if cut.any():
            sentence = (
                f"{cut.mean():.1%} of its samples are at the end of its range and were left out, with what is around"
                " them: set a larger range, or move more slowly."
            )
            findings.append(Remark("saturated", sentence, False))
        findings += _stuck(clean.imu, cut) or _gravity(clean.imu)
    return clean, findings


def _stuck(imu: ImuTrace, cut: BoolArray) -> list[Remark]:
    """Find axes whose value stays the same for long while another one varies: they are stuck, or cut off there."""
    values = np.hstack([imu.angular_velocity, imu.acceleration])
    stuck = []
    for axis, name in enumerate(_AXES):
        edges = np.concatenate([[0], np.flatnonzero(np.diff(values[:, axis])) + 1, [len(values)]])
        longest = int(np.argmax(np.diff(edges)))
        begin, end = edges[longest], edges[longest + 1]
        others = np.ptp(values[begin:end], axis=0) > _VARIES
        lasted = imu.stamp[end - 1] - imu.stamp[begin]
        if lasted > _STUCK_S and others.any() and not cut[begin]:
            stuck.append(f"its {name} stays at {values[begin, axis]:.4g} for {lasted:.1f} s")
    if not stuck:
        return []
    way_out = "restart the unit, or replace it; if its range ends there, set a larger one"
    return [Remark("stuck", f"While others vary, {', '.join(stuck)}: {way_out}.", True)]


def _gravity(imu: ImuTrace) -> list[Remark]:
    """Find an accelerometer that does not measure gravity, which a calibration motion hardly adds to."""
    gravity = float(np.median(np.linalg.norm(imu.acceleration, axis=1)))
    if 0.7 < gravity / GRAVITY < 1.4:
        return []
    cause = mistaken("accelerometer", gravity / GRAVITY)
    sentence = f"Its accelerometer measures {gravity:.4g} m/s^2 where gravity is 9.81: {cause}."
    return [Remark("gravity", sentence, True)]
