"""What is to be said of a unit once its place is found."""

import numpy as np

from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located
from pretouch.calibration.observability import Observability
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Finding
from pretouch.types import FloatArray

_UNUSUAL = 5.0
"""Standard deviations, as assumed, from which on an error of a sensor is not its own."""
_MANY = 0.05
"""Share of outliers from which on they are worth a word."""
_LONG_S = 0.5
"""Outliers that last for longer, up to an end of the run, are of a unit that is not there [s]."""


def end_finding(arm: ArmMotion, located: Located) -> Finding | None:
    """Say when a unit began, or ceased, to move as its link, near an end of the run: one pose does not hold there."""
    known = np.flatnonzero(located.known)
    fits = np.flatnonzero(located.used[known])
    if not len(fits):
        return None
    long = _LONG_S / float(arm.time[1] - arm.time[0])
    if len(known) - 1 - fits[-1] > long:
        since = arm.time[known[fits[-1]]] - arm.time[0]
        what = f"It slipped, or came off, {since:.1f} s after the first joint state: from then on"
    elif fits[0] > long:
        until = arm.time[known[fits[0]]] - arm.time[0]
        what = f"It slipped, or was put on, {until:.1f} s after the first joint state: until then"
    else:
        return None
    return Finding("slipped", f"{what} it did not move with its link. Fasten it and calibrate again.", True)


def share_findings(arm: ArmMotion, located: Located, params: CalibrationParams) -> list[Finding]:
    """Say how much of the run was left out, and what of the rest is not explained."""
    whole = float(arm.usable.sum())
    missing, outliers = (1 - located.known.sum() / whole), float((located.known & ~located.used).sum()) / whole
    findings = []
    if missing + outliers > params.unusable:
        sentence = (
            f"{missing + outliers:.0%} of the run could not be used (limit {params.unusable:.0%}): during {missing:.0%}"
            f" it measured nothing or was out of range, and during {outliers:.0%} it did not move with its link. Fix"
            " that and calibrate again."
        )
        findings.append(Finding("unusable", sentence, True))
    elif outliers > _MANY:
        sentence = (
            f"During {outliers:.0%} of the run it did not move with its link, so that part was left out: check whether"
            " it is loose."
        )
        findings.append(Finding("outliers", sentence, False))
    turning, acceleration = float(located.noise[0]), float(located.noise[3])
    if turning > params.tolerated_angular_velocity or acceleration > params.tolerated_acceleration:
        sentence = (
            f"{turning:.3g} rad/s and {acceleration:.3g} m/s^2 of its measurements are unexplained (limits"
            f" {params.tolerated_angular_velocity:g} rad/s and {params.tolerated_acceleration:g} m/s^2). Check that it"
            " is fastened, and that scales and axes of both sensors are right."
        )
        findings.append(Finding("unexplained", sentence, True))
    return findings


def error_findings(located: Located, params: CalibrationParams) -> list[Finding]:
    """Name errors of the IMU that are too large to be its own."""
    e = located.estimate
    findings = []
    for name, si, bias, usual, scale in (
        ("accelerometer", "m/s^2", e.acceleration_bias, params.acceleration_bias, e.acceleration_scale),
        ("gyroscope", "rad/s", e.angular_velocity_bias, params.angular_velocity_bias, e.angular_velocity_scale),
    ):
        axis = int(np.argmax(np.abs(scale)))
        if abs(scale[axis]) > _UNUSUAL * params.scale_error:
            way_out = "correct its sign" if scale[axis] < -1 else "check its range"
            sentence = (
                f"The scale of its {name} {'xyz'[axis]} seems to be {1 + scale[axis]:.2f} instead of 1: {way_out}."
            )
            findings.append(Finding("scale", sentence, True))
        axis = int(np.argmax(np.abs(bias)))
        if abs(bias[axis]) > _UNUSUAL * usual:
            sentence = f"Its {name} {'xyz'[axis]} is off by {bias[axis]:.3g} {si}: check the sensor."
            findings.append(Finding("bias", sentence, False))
    return findings


def unknown_finding(
    arm: ArmMotion, link: int, known: Observability, noise: FloatArray | None, params: CalibrationParams
) -> list[Finding]:
    """Say what of a place is not known, why, and what to do.

    Args:
        arm: the run.
        link: index of the link.
        known: what of the place is known.
        noise: (n,) of the joints' accelerations [rad/s^2], if it is what hides the place.
        params: what has not moved.
    """
    if not known.unknown:
        return []
    model, moving = arm.model, arm.model.moved_by[link]
    swing: FloatArray = np.ptp(arm.q[arm.usable], axis=0)
    lazy = np.flatnonzero(moving & (swing < 10 * params.least_swing_rad))
    names = ", ".join(f"{model.joints[j]} (it moved by {np.rad2deg(swing[j]):.1f} degrees)" for j in lazy)
    way_out = "Move for longer, or faster, and turn about more axes."
    if len(lazy):
        way_out = f"Move {names} more."
    elif noise is not None:
        worst = int(np.argmax(np.where(moving, noise, 0.0)))
        way_out = (
            f"The noise of the joint positions hides it, mostly that of {model.joints[worst]}, equal to"
            f" {noise[worst]:.2g} rad/s^2: record positions with all their digits, each with its own stamp."
        )
    if moving.sum() == 1:
        joint = model.joints[int(np.flatnonzero(moving)[0])]
        way_out = f"{joint} alone moves {model.links[link]}, so no motion can determine it: measure it by hand."
    rest = f" Known: {_listed(known.known)}." if known.known else ""
    return [Finding("unobservable", f"Not known: {_listed(known.unknown)}.{rest} {way_out}", True)]


def _listed(words: tuple[str, ...]) -> str:
    return ", and ".join(words)
