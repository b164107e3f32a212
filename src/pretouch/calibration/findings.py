"""What is to be said of a unit once its place is found."""

import numpy as np

from pretouch.calibration.identify import Identified
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.locate import Located
from pretouch.calibration.observability import Observability
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.result import Finding
from pretouch.calibration.steadiness import Slip
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_UNUSUAL = 5.0
"""Standard deviations, as assumed, from which on an error of a sensor is not its own."""
_MANY = 0.05
"""Share of outliers from which on they are worth a word."""


def misplaced(model: RobotModel, given: dict[str, str | None], found: dict[str, Identified]) -> dict[str, Finding]:
    """Name units that sit elsewhere than they are said to: by id. Those that sit in each other's place are swapped.

    Args:
        model: the arm.
        given: link of each unit, as the user says.
        found: what is known of each unit's link.
    """
    wrong = {
        name: said
        for name, said in given.items()
        if said is not None and found[name].body and model.link_index(said) not in found[name].body
    }

    def takes(name: str, other: str) -> bool:
        """Whether one sits where the other one is said to."""
        return name != other and model.link_index(wrong[other]) in found[name].body

    findings = {}
    for name, said in wrong.items():
        links = _on(model, found[name].body)
        owners = [other for other in wrong if takes(name, other)]
        mutual = [other for other in owners if takes(other, name)]
        sentence = f"It is said to sit on {said}, but its data fit {links}: correct its link, or move it."
        if owners:
            other = (mutual or owners)[0]
            sentence = f"It sits on {links}, where {other} should, instead of on {said}: correct its link, or move it."
        if mutual:
            sentence = f"Swapped with {mutual[0]}: it sits on {links}, where {mutual[0]} should, instead of on {said};"
            sentence += " exchange the two, or their ids."
        findings[name] = Finding("swapped" if mutual else "wrong_link", sentence, True)
    return findings


def _on(model: RobotModel, body: tuple[int, ...]) -> str:
    """Name the links of a rigid body that have a surface, or all if none has."""
    covered = [i for i in body if i in model.capsules.link]
    return " or ".join(model.links[i] for i in covered or body)


def slip_finding(slip: Slip, begin: float) -> Finding:
    """Say when and how far a unit slipped; `begin` of the run [s]."""
    sentence = (
        f"It slipped by {1000 * slip.distance:.1f} mm and {np.rad2deg(slip.angle):.1f} degrees,"
        f" {slip.earliest - begin:.1f} s to {slip.latest - begin:.1f} s after the first joint state: fasten it and"
        " calibrate again."
    )
    return Finding("slipped", sentence, True)


def share_findings(arm: ArmMotion, located: Located, params: CalibrationParams) -> list[Finding]:
    """Say how much of the run was left out, and what of the rest is not explained."""
    whole = float(arm.usable.sum())
    missing, outliers = (1 - located.known.sum() / whole), float((located.known & ~located.used).sum()) / whole
    findings = []
    if missing + outliers > params.unusable:
        sentence = (
            f"{missing + outliers:.0%} of the run could not be used, {params.unusable:.0%} are bearable: during"
            f" {missing:.0%} it measured nothing or was out of range, during {outliers:.0%} it did not move as its"
            " link. Mend that and calibrate again."
        )
        findings.append(Finding("unusable", sentence, True))
    elif outliers > _MANY:
        sentence = (
            f"During {outliers:.0%} of the run it did not move as its link, and was left out: was it knocked, or is it"
            " loose?"
        )
        findings.append(Finding("outliers", sentence, False))
    turning, acceleration = float(located.noise[0]), float(located.noise[3])
    if turning > params.tolerated_angular_velocity or acceleration > params.tolerated_acceleration:
        sentence = (
            f"{turning:.3g} rad/s and {acceleration:.3g} m/s^2 of what it measured are not explained:"
            f" {params.tolerated_angular_velocity:g} rad/s and {params.tolerated_acceleration:g} m/s^2 are bearable."
            " Check that it is fastened, and that scales and axes of both sensors are right."
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


def unknown_finding(arm: ArmMotion, link: int, known: Observability, params: CalibrationParams) -> list[Finding]:
    """Say what of a place is not known, why, and what to do."""
    if not known.unknown:
        return []
    model, moving = arm.model, arm.model.moved_by[link]
    swing: FloatArray = np.ptp(arm.q[arm.usable], axis=0)
    lazy = np.flatnonzero(moving & (swing < 10 * params.least_swing_rad))
    names = ", ".join(f"{model.joints[j]} (it moved by {np.rad2deg(swing[j]):.1f} degrees)" for j in lazy)
    way_out = f"Move {names} more." if len(lazy) else "Move for longer, or faster, and turn about more axes."
    if moving.sum() == 1:
        joint = model.joints[int(np.flatnonzero(moving)[0])]
        way_out = f"{joint} alone moves {model.links[link]}, so no motion tells it: measure it by hand."
    rest = f" Known are {_listed(known.known)}." if known.known else ""
    return [Finding("unobservable", f"Not known: {_listed(known.unknown)}.{rest} {way_out}", True)]


def _listed(words: tuple[str, ...]) -> str:
    return ", and ".join(words)
