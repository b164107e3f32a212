"""Limits of an arm's joints: what its file says, what is said beside it, and else an assumption with a sentence."""

from dataclasses import dataclass

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.chain import Arm
from pretouch.types import FloatArray

_ENDLESS = 2 * np.pi
_SPEED, _ACCELERATION, _TORQUE = 1.0, 5.0, 50.0
"""Where nothing is known: slow, gentle and middling [rad/s, rad/s^2, Nm]."""
_LARGEST_POSITION, _LARGEST_SPEED, _LARGEST_TORQUE = 4 * np.pi, 50.0, 5000.0
"""What no joint of an arm has [rad, rad/s, Nm]."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of n joints."""

    q_min: FloatArray
    """(n,) [rad]."""
    q_max: FloatArray
    """(n,) [rad]."""
    qd_max: FloatArray
    """(n,) [rad/s]."""
    qdd_max: FloatArray
    """(n,) [rad/s^2]."""
    tau_max: FloatArray
    """(n,) [Nm]."""
    remarks: tuple[str, ...]
    """What was assumed, a sentence each."""


def limits_of(
    arm: Arm, qd_max: tuple[float, ...] = (), qdd_max: tuple[float, ...] = (), tau_max: tuple[float, ...] = ()
) -> Limits:
    """Return an arm's limits; those given, one for all joints or one for each, take the place of the file's."""
    remarks: list[str] = []
    endless = [joint.name for joint in arm.joints if joint.limits is None]
    if endless:
        remarks.append(
            f"{', '.join(endless)}: no position limits in the file, so -2 pi to 2 pi is assumed; give each a"
            " lower and an upper one there, or correct the range in arm.xml."
        )
    ranges = np.array([joint.limits or (-_ENDLESS, _ENDLESS) for joint in arm.joints])
    speed = [joint.velocity for joint in arm.joints]
    torque = [joint.effort for joint in arm.joints]
    nothing: list[float | None] = [None] * len(arm.joints)
    speeds = _settled(arm, "velocity", "--qd-max", "rad/s", speed, qd_max, _SPEED, remarks)
    accelerations = _settled(arm, "acceleration", "--qdd-max", "rad/s^2", nothing, qdd_max, _ACCELERATION, remarks)
    torques = _settled(arm, "torque", "--tau-max", "Nm", torque, tau_max, _TORQUE, remarks)
    for what, unit, values, largest in (
        ("position", "rad", np.abs(ranges).max(axis=1), _LARGEST_POSITION),
        ("velocity", "rad/s", speeds, _LARGEST_SPEED),
        ("torque", "Nm", torques, _LARGEST_TORQUE),
    ):
        beyond = [f"{joint.name} ({v:g} {unit})" for joint, v in zip(arm.joints, values, strict=True) if v > largest]
        if beyond:
            degrees = ", perhaps degrees in place of radians" if len(beyond) > 1 and what != "torque" else ""
            remarks.append(
                f"Implausible {what} limits{degrees}, correct them in the file or robot.toml: {', '.join(beyond)}."
            )
    return Limits(ranges[:, 0], ranges[:, 1], speeds, accelerations, torques, tuple(remarks))


def _settled(
    arm: Arm, what: str, option: str, unit: str, found: list[float | None], given: tuple[float, ...], default: float,
    remarks: list[str],
) -> FloatArray:  # fmt: skip
    n = len(arm.joints)
    if given:
        if len(given) not in (1, n) or not all(np.isfinite(given)) or min(given) <= 0:
            listed = ", ".join(f"{v:g}" for v in given)
            raise RobotModelError(f"{option} is {listed}: give one positive number [{unit}], or {n}, by commas.")
        return np.broadcast_to(np.array(given, dtype=np.float64), n).copy()
    missing = [joint.name for joint, value in zip(arm.joints, found, strict=True) if value is None]
    if missing:
        who = "all joints" if len(missing) == n else ", ".join(missing)
        remarks.append(f"The file has no {what} limit of {who}: {default:g} {unit} is assumed; give {option}.")
    return np.array([default if value is None else abs(value) for value in found])
