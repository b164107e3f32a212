"""What is known of an arm beside its MJCF: limits, names, postures, and where each figure comes from."""

from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.types import FloatArray


@dataclass(frozen=True)
class SpeedEnvelope:
    """Speed limits of n joints that fall towards the ends of their ranges, as a robot's interface enforces them.

    Towards its upper end a joint at q may move at max(0, -offset + sqrt(slope (q_upper - q))), towards its lower end at
    max(0, -offset + sqrt(slope (q - q_lower))), whatever its constant limit allows beyond that. Each reaches zero
    offset^2 / slope before its reference. Away from an end nothing is asked.
    """

    offset: FloatArray
    """(n,) [rad/s]."""
    slope: FloatArray
    """(n,) [rad/s^2]: along the envelope a joint slows by at most half of it."""
    q_upper: FloatArray
    """(n,) reference of the upper side [rad]; it may lie beyond the joint's position limit."""
    q_lower: FloatArray
    """(n,) reference of the lower side [rad]."""
    source: str
    """Where the figures were read."""

    def __post_init__(self) -> None:
        shape = self.offset.shape
        for name in ("offset", "slope", "q_upper", "q_lower"):
            value = getattr(self, name)
            if value.shape != shape or len(shape) != 1 or not np.all(np.isfinite(value)):
                raise RobotModelError(f"Speed envelope: {name} is {value}: give one finite number a joint.")
        if np.any(self.offset < 0):
            raise RobotModelError(f"Speed envelope: offset is {self.offset}: none may be negative.")
        if np.any(self.slope <= 0):
            raise RobotModelError(f"Speed envelope: slope is {self.slope}: all must be positive.")
        if np.any(self.q_upper - self.q_lower <= 2 * self.offset**2 / self.slope):
            raise RobotModelError(
                f"Speed envelope: between q_lower {self.q_lower} and q_upper {self.q_upper} a joint cannot move in both"
                " directions: give each q_upper above its q_lower."
            )

    def moved_in(self, margin: float) -> "SpeedEnvelope":
        """Return the envelope with both sides moved inwards by a margin [rad]."""
        return replace(self, q_upper=self.q_upper - margin, q_lower=self.q_lower + margin)


@dataclass(frozen=True)
class RobotDescription:
    """An arm of n hinge joints in one chain, described by an MJCF file and its limits.

    The base frame O is the frame of the MJCF's world. Joint position limits are the MJCF's own.
    """

    name: str
    mjcf: Path
    """MJCF file; its capsule geoms are taken as the arm's body."""
    ee_body: str
    """Body whose origin is the end-effector (TCP)."""
    qd_max: FloatArray
    """(n,) joint velocity limits [rad/s]."""
    qdd_max: FloatArray
    """(n,) joint acceleration limits [rad/s^2]."""
    tau_max: FloatArray
    """(n,) joint torque limits [Nm]."""
    q_ready: FloatArray
    """(n,) usual posture to start from [rad]."""
    source: str
    """Where the limits were read."""
    envelope: SpeedEnvelope | None = None
    """Speed limits that depend on the position, beside `qd_max`; None if there are none."""

    def __post_init__(self) -> None:
        n = len(self.q_ready)
        for name in ("qd_max", "qdd_max", "tau_max"):
            value = getattr(self, name)
            if value.shape != (n,) or not np.all(np.isfinite(value)) or np.any(value <= 0):
                raise RobotModelError(f"{self.name}: {name} is {value}: give {n} positive, finite numbers.")
        if self.envelope is not None and self.envelope.offset.shape != (n,):
            raise RobotModelError(
                f"{self.name}: the speed envelope is for {len(self.envelope.offset)} joints: give {n} of each number."
            )
        if not self.mjcf.is_file():
            raise RobotModelError(f"{self.name}: the MJCF file {self.mjcf} does not exist: check its name.")


def panda() -> RobotDescription:
    """Franka Emika Panda with hand. Limits as published by the vendor (libfranka, `rate_limiting.h`)."""
    return RobotDescription(
        name="panda",
        mjcf=Path(str(files("pretouch.robot") / "data" / "panda.xml")),
        ee_body="panda_hand_tcp",
        qd_max=np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61]),
        qdd_max=np.array([15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]),
        tau_max=np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]),
        q_ready=np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]),
        source="libfranka rate_limiting.h and the vendor's robot and interface specifications",
    )


def fr3() -> RobotDescription:
    """Franka Research 3 with hand. Limits as published by the vendor (libfranka, `rate_limiting.h`).

    The speed envelope of joints 2, 3 and 7 ends 0.1 to 0.4 mrad beyond their position limits: both apply.
    """
    source = "libfranka rate_limiting.h for the FR3, franka_description 1.1.0"
    return RobotDescription(
        name="fr3",
        mjcf=Path(str(files("pretouch.robot") / "data" / "fr3.xml")),
        ee_body="fr3_hand_tcp",
        qd_max=np.array([2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]),
        qdd_max=np.full(7, 10.0),
        tau_max=np.array([87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0]),
        q_ready=np.array([0.0, -np.pi / 4, 0.0, -3 * np.pi / 4, 0.0, np.pi / 2, np.pi / 4]),
        source=source,
        envelope=SpeedEnvelope(
            offset=np.array([0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35]),
            slope=np.array([12.0, 5.17, 7.0, 8.0, 34.0, 11.0, 34.0]),
            q_upper=np.array([2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196]),
            q_lower=np.array([-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.0196]),
            source=source,
        ),
    )
