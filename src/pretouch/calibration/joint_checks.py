"""What can be wrong with measured joint positions."""

import numpy as np

from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Finding
from pretouch.calibration.signals import gaps
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.traces import JointTrace
from pretouch.types import BoolArray, FloatArray

_BEYOND = 0.2
"""How far beyond its limits no joint is ever measured [rad]."""
_SPARSE = 100
"""Stamps that span more than this many times the time their samples take are not all of one clock."""


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
    fresh = np.append(True, np.diff(joints.stamp) > 0)[: len(joints.stamp)]
    if not fresh.all():
        findings.append(_repeated(fresh))
    joints = JointTrace(joints.stamp[fresh], joints.q[fresh])
    _check_range(model, joints.q)
    _check_rate(joints.stamp, params)
    return joints, (*findings, *_missing(joints.stamp, params))


def moved_joints(joints: JointTrace, params: CalibrationParams) -> BoolArray:
    """Tell which joints moved (n,). CalibrationError if none did."""
    low, high = np.percentile(joints.q, (1.0, 99.0), axis=0)
    moved: BoolArray = high - low > params.least_swing_rad
    if not moved.any():
        raise CalibrationError(
            f"The arm did not move: no joint by more than {np.rad2deg((high - low).max()):.2g} degrees; let it make a"
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
        f"{names} did not move: the links on either side cannot be told apart, and units beyond are known less"
        f" well.{stayed} Move every joint."
    )
    return (Finding("joints_stood", sentence, False),)


def _not_finite(finite: BoolArray) -> Finding:
    sentence = f"{np.sum(~finite)} joint states of {len(finite)} are not finite and were left out: check their source."
    return Finding("joints_not_finite", sentence, False)


def _repeated(fresh: BoolArray) -> Finding:
    sentence = (
        f"{np.sum(~fresh)} joint states of {len(fresh)} have the stamp of the one before and were left out: record each"
        " state once."
    )
    return Finding("joints_repeated", sentence, False)


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
            f"{model.joints[j]} is at {worst:.4g} rad, out of its range from {model.q_min[j]:.4g} to"
            f" {model.q_max[j]:.4g}: give radians, in the order of the arm's joints, of this arm."
        )


def _check_rate(stamp: FloatArray, params: CalibrationParams) -> None:
    span = float(np.ptp(stamp)) if len(stamp) else 0.0
    if span < params.shortest_s:
        raise CalibrationError(
            f"There are {len(stamp)} joint states in {span:.3g} s: at least {params.shortest_s:g} s of motion are"
            " needed, 60 s are good."
        )
    period = float(np.median(np.diff(stamp)))
    if span > _SPARSE * period * len(stamp):
        raise CalibrationError(
            f"{len(stamp)} joint states, mostly {period:.3g} s apart, are spread over {span:.3g} s: give those of one"
            " run, on one clock, in seconds."
        )
    if period > params.longest_gap_s:
        raise CalibrationError(
            f"Joint states came every {period:.3g} s: at least every {params.longest_gap_s:g} s are needed; record them"
            " at 100 Hz or more."
        )


def _missing(stamp: FloatArray, params: CalibrationParams) -> tuple[Finding, ...]:
    holes = gaps(stamp, params.longest_gap_s)[1:-1]
    if not len(holes):
        return ()
    long = holes[:, 1] - holes[:, 0]
    first = holes[np.argmax(long), 0] - stamp[0]
    sentence = (
        f"Gaps in the joint states: {len(holes)}, {long.sum():.2f} s in all, the longest {long.max():.2f} s from"
        f" {first:.1f} s after the first one on. What units measured around them was left out: record all of them."
    )
    return (Finding("joints_missing", sentence, False),)
