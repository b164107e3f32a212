"""What is known of an arm beside its MJCF: limits, names, postures, and where each figure comes from."""

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np

from pretouch.errors import RobotModelError
from pretouch.types import FloatArray


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

    def __post_init__(self) -> None:
        n = len(self.q_ready)
        for name in ("qd_max", "qdd_max", "tau_max"):
            value = getattr(self, name)
            if value.shape != (n,) or not np.all(np.isfinite(value)) or np.any(value <= 0):
                raise RobotModelError(f"{self.name}: {name} is {value}: give {n} positive, finite numbers.")
        if not self.mjcf.is_file():
            raise RobotModelError(f"{self.name}: there is no MJCF file at {self.mjcf}.")


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
