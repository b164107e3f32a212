"""The external wrench: brought to our sign and frame, or None where there is no estimate."""

from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch_ros2.params import ArmParams
from pretouch_ros2.stamps import Stamps

_EE_FRAMES = ("_k", "_ee", "_tcp", "_hand", "link8", "tool0", "_flange")
"""How the names of end-effectors' frames end."""


class Wrench:
    """Takes in geometry_msgs/WrenchStamped."""

    def __init__(self, params: ArmParams, stamps: Stamps) -> None:
        self._params, self.stamps = params, stamps
        self._newest: tuple[float, FloatArray] | None = None
        self.received_any = False
        """Whether any message came, with an estimate or without."""
        self.frame_id = ""

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in."""
        self.received_any, self.frame_id = True, message.header.frame_id
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is None:
            return
        f, t = message.wrench.force, message.wrench.torque
        self._newest = stamp, np.array([f.x, f.y, f.z, t.x, t.y, t.z])

    def read(self, now: float, R_O_ee: FloatArray) -> FloatArray | None:
        """Return force and torque (6,) [N, Nm] on the robot by the environment, base frame, or None.

        Args:
            now: by the monotonic clock [s].
            R_O_ee: (3, 3) orientation of the end-effector.
        """
        if self._newest is None:
            return None
        stamp, given = self._newest
        absent = self._params.zeros_missing and not given.any()
        if absent or now - stamp > self._params.wrench_timeout_s or not np.isfinite(given).all():
            return None
        return our_wrench(given, self._params, R_O_ee)

    @property
    def warning(self) -> str:
        """What makes the setting of the frame look wrong, as a sentence, or ''."""
        looks_ee = self.frame_id.lower().endswith(_EE_FRAMES)
        if looks_ee == (self._params.frame == "ee") or not self.frame_id:
            return ""
        return (
            f"The wrench's frame_id is {self.frame_id!r}, but the frame is set to {self._params.frame!r}: check the"
            " setting."
        )


def our_wrench(given: FloatArray, params: ArmParams, R_O_ee: FloatArray) -> FloatArray:
    """Bring a wrench (6,) [N, Nm] to our sign and frame: the one place where that is done."""
    ours = -given if params.sign == "by-robot" else given
    if params.frame == "base":
        return ours.copy()
    return np.concatenate([R_O_ee @ ours[:3], R_O_ee @ ours[3:]])
