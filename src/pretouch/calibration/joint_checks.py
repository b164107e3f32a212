"""What can be wrong with measured joint positions."""

import numpy as np

from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Finding
from pretouch.calibration.signals import gaps, median_period, of_several_clocks
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.traces import JointTrace
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


def checked_joints(
    model: RobotModel, joints: JointTrace, params: CalibrationParams
) -> tuple[JointTrace, tuple[Finding, ...]]:
    """Return joint positions at increasing instants, and what is to be known of them.

    Raises CalibrationError for what nothing can be made from.
    """
    stamp, q = np.asarray(joints.stamp, dtype=np.float64), np.asarray(joints.q, dtype=np.float64)
    if stamp.ndim != 1 or q.shape != (len(stamp), model.n):
        raise CalibrationError(
            f"Joint positions have the shape {q.shape} at {stamp.shape} stamps: give one row for each stamp, of the"
            f" {model.n} joints of {model.description.name}."
        )
    finite = np.isfinite(stamp) & np.isfinite(q).all(axis=1)
    findings = [] if finite.all() else [_not_finite(finite)]
    joints = JointTrace(stamp[finite], q[finite])
    _check_order(joints.stamp)
    _check_range(model, joints.q)
    _check_span(joints.stamp, params)
    count = len(joints.stamp)
    for choice in (_own_stamp, _spaced, _renewed):
        joints = joints.at(choice(joints, params))
    if len(joints.stamp) < count:
        findings.append(_repeated(count - len(joints.stamp), count))
    _check_rate(joints, params)
    return joints, (*findings, *_missing(joints.stamp, params))


def moved_joints(joints: JointTrace, params: CalibrationParams) -> BoolArray:
    """Tell which joints moved (n,). CalibrationError if none did."""
    low, high = np.percentile(joints.q, (1.0, 99.0), axis=0)
    moved: BoolArray = high - low > params.least_swing_rad
    if not moved.any():
        raise CalibrationError(
            f"The arm did not move: no joint by more than {np.rad2deg((high - low).max()):.2g} degrees; run a"
            " calibration motion while units and joints are recorded."
        )
    return moved


def held(joints: JointTrace, moved: BoolArray) -> JointTrace:
    """Return the same positions, with joints that did not move (n,) at rest: their noise would pass for a motion."""
    return JointTrace(joints.stamp, np.where(moved, joints.q, np.median(joints.q, axis=0)))


def check_known(arm: ArmMotion, params: CalibrationParams) -> None:
    """Raise CalibrationError if too little of the motion is known."""
    known = float(arm.usable.sum() * (arm.time[1] - arm.time[0]))
    if known < params.shortest_s:
        raise CalibrationError(
            f"Joint states without gaps make up {known:.1f} s: at least {params.shortest_s:g} s are needed, with no gap"
            f" beyond {params.longest_gap_s:g} s; record joint states at 100 Hz or more."
        )


def standing_joints(model: RobotModel, moved: BoolArray) -> tuple[Finding, ...]:
    """Say which joints did not move (n,), and what follows for the links."""
    if moved.all():
        return ()
    names = ", ".join(np.array(model.joints)[~moved])
    still = np.flatnonzero(~model.moved_by[1:][:, moved].any(axis=1)) + 1
    stayed = f" {', '.join(model.links[i] for i in still)} did not move at all." if len(still) else ""
    sentence = (
        f"{names} did not move, so the links on either side cannot be distinguished, and units beyond are located less"
        f" well.{stayed} Move every joint."
    )
    return (Finding("joints_stood", sentence, False),)


def _not_finite(finite: BoolArray) -> Finding:
    sentence = f"{np.sum(~finite)} joint states of {len(finite)} are not finite and were left out: check their source."
    return Finding("joints_not_finite", sentence, False)


def _own_stamp(joints: JointTrace, params: CalibrationParams) -> BoolArray:
    """Tell which states (T,) to keep of those with the same stamp: the last, stamped on receipt the least late.

    A few with different values are all left out: of these, the last may as well have the stamp of the one before.
    """
    same = np.diff(joints.stamp) == 0
    keep = np.append(~same, True)
    others = same & _changes(joints.q)
    if others.mean() < _FEW:
        keep &= ~np.append(False, others)
    return np.asarray(keep)


def _repeated(left_out: int, count: int) -> Finding:
    sentence = (
        f"{left_out} joint states of {count} repeat the values of the one before, or have the stamp of another one or"
        " nearly so, and were left out: record each measurement once, stamped where it is measured."
    )
    return Finding("joints_repeated", sentence, False)


def _spaced(joints: JointTrace, params: CalibrationParams) -> BoolArray:
    """Tell which states (T,) no other follows closely: stamped on receipt, the last is the least late."""
    stamp, steps = joints.stamp, np.diff(joints.stamp)
    regular = steps[steps <= params.longest_gap_s]
    keep = np.ones(len(stamp), np.bool_)
    if len(regular):
        nearest, following = _BUNCHED * float(regular.mean()), np.inf
        for i in range(len(stamp) - 1, -1, -1):
            keep[i] = following - stamp[i] >= nearest
            following = stamp[i] if keep[i] else following
    return keep


def _renewed(joints: JointTrace, params: CalibrationParams) -> BoolArray:
    """Tell which states (T,) are not of a value that was only held until the next one came; an arm may stand longer."""
    same = np.append(False, ~_changes(joints.q))
    first = np.flatnonzero(~same)
    lasts = np.append(np.diff(joints.stamp[first]), np.inf)
    return np.asarray(~same | np.repeat(lasts > params.longest_gap_s, np.diff(np.append(first, len(same)))))


def _changes(q: FloatArray) -> BoolArray:
    """Tell at which states but the first (T - 1,) any position differs from that before."""
    return np.asarray((np.diff(q, axis=0) != 0).any(axis=1))


def _check_order(stamp: FloatArray) -> None:
    back = np.flatnonzero(np.diff(stamp) < 0)
    if len(back):
        i = int(back[0])
        raise CalibrationError(
            f"The stamps of the joint states go back, first from {stamp[i]:.6f} s to {stamp[i + 1]:.6f} s at state"
            f" {i + 1}: give them in the order in which they were measured, on one clock."
        )


def _check_range(model: RobotModel, q: FloatArray) -> None:
    beyond = np.maximum(model.q_min - q, q - model.q_max) > _BEYOND
    if beyond.any():
        j = int(np.argmax(beyond.sum(axis=0)))
        worst = q[np.argmax(np.maximum(model.q_min[j] - q[:, j], q[:, j] - model.q_max[j])), j]
        raise CalibrationError(
            f"{model.joints[j]} is at {worst:.4g} rad, outside its range from {model.q_min[j]:.4g} to"
            f" {model.q_max[j]:.4g}: give radians, in the order of the arm's joints, of this arm."
        )


def _check_span(stamp: FloatArray, params: CalibrationParams) -> None:
    span = float(np.ptp(stamp)) if len(stamp) else 0.0
    if span < params.shortest_s:
        raise CalibrationError(
            f"There are {len(stamp)} joint states in {span:.3g} s: at least {params.shortest_s:g} s of motion are"
            " needed, 60 s are recommended."
        )
    if of_several_clocks(stamp):
        raise CalibrationError(
            f"{len(stamp)} joint states, mostly {median_period(stamp):.3g} s apart, are spread over {span:.3g} s: give"
            " those of one run, on one clock, in seconds."
        )


def _check_rate(joints: JointTrace, params: CalibrationParams) -> None:
    """Refuse states, or changes of their values, that are too far apart."""
    changed = np.append(True, _changes(joints.q))
    periods = [median_period(stamp) for stamp in (joints.stamp, joints.stamp[changed]) if len(stamp) > 1]
    period, enough = max(periods), _REGULAR * params.longest_gap_s
    if period > 1.05 * enough:
        raise CalibrationError(
            f"New joint positions came every {period:.3g} s ({1 / period:.3g} Hz): at least {1 / enough:.3g} Hz are"
            " needed; record them at 100 Hz or more."
        )


def _missing(stamp: FloatArray, params: CalibrationParams) -> tuple[Finding, ...]:
    holes = gaps(stamp, params.longest_gap_s)[1:-1]
    if not len(holes):
        return ()
    long = holes[:, 1] - holes[:, 0]
    first = holes[np.argmax(long), 0] - stamp[0]
    sentence = (
        f"Gaps in the joint states: {len(holes)}, {long.sum():.2f} s in all, the longest {long.max():.2f} s from"
        f" {first:.1f} s after the first one on. Samples of units around them were left out: record all states."
    )
    return (Finding("joints_missing", sentence, False),)
