"""What an arm estimates of external forces: the wrench and the joint torques, in our sign, frame and order."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch_ros2.joints import places_of
from pretouch_ros2.messages import FRANKA_STATE, JOINT_STATE
from pretouch_ros2.params import ArmParams
from pretouch_ros2.stamps import SourceStamps

_EE_FRAMES = ("_k", "_ee", "_tcp", "_hand", "link8", "tool0", "_flange")
"""How the names of end-effectors' frames end."""


class _ForceEstimate:
    """The newest numbers of one topic."""

    def __init__(self, params: ArmParams, stamps: SourceStamps) -> None:
        self._params, self.stamps = params, stamps
        self._newest: tuple[float, FloatArray] | None = None

    def _note(self, message: Any, received: float, writer: int, given: FloatArray) -> None:
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is not None:
            self._newest = stamp, given

    def _ours(self, now: float) -> FloatArray | None:
        """Return the numbers in our sign, which is on the robot by the environment: the one place where that is done.

        None where they are older at an instant [s] than they may be, or are zeros which mean that there is no estimate.
        """
        if self._newest is None:
            return None
        stamp, numbers = self._newest
        if now - stamp > self._params.wrench_timeout_s or (self._params.zeros_missing and not numbers.any()):
            return None
        return -numbers if self._params.sign == "by-robot" else numbers.copy()


class Wrench(_ForceEstimate):
    """Takes in geometry_msgs/WrenchStamped."""

    received_any = False
    """Whether any message came, with an estimate or without."""
    frame_id = ""

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in."""
        self.received_any, self.frame_id = True, message.header.frame_id
        f, t = message.wrench.force, message.wrench.torque
        self._note(message, received, writer, np.array([f.x, f.y, f.z, t.x, t.y, t.z]))

    def read(self, now: float, R_O_ee: FloatArray) -> FloatArray | None:
        """Return force and torque (6,) [N, Nm] on the robot by the environment, base frame, or None.

        Args:
            now: by the monotonic clock [s].
            R_O_ee: (3, 3) orientation of the end-effector.
        """
        ours = self._ours(now)
        if ours is None or not np.isfinite(ours).all():
            return None
        return ours if self._params.frame == "base" else np.concatenate([R_O_ee @ ours[:3], R_O_ee @ ours[3:]])

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


class TorqueEstimate(_ForceEstimate):
    """Takes in sensor_msgs/JointState, or the one in franka_msgs/FrankaRobotState, whose efforts they are."""

    others: tuple[str, ...] = ()
    """Joints named in the newest message that was not of all of ours; some of them, where there are many."""

    def __init__(self, params: ArmParams, names: Sequence[str], stamps: SourceStamps) -> None:
        super().__init__(params, stamps)
        self._names = tuple(names)

    @property
    def kind(self) -> str:
        """Type of the messages."""
        return FRANKA_STATE if self._params.torques.endswith("robot_state") else JOINT_STATE

    @property
    def received_any(self) -> bool:
        """Whether torques of all of our joints came."""
        return self._newest is not None

    def take(self, message: Any, received: float, writer: int) -> None:
        """Take a message in; one without efforts of all of our joints is another device's."""
        state = getattr(message, "tau_ext_hat_filtered", message)
        places = places_of(self._names, state.name)
        if places is None or len(state.effort) != len(state.name):
            self.others = tuple(state.name[:9])
        else:
            self._note(message, received, writer, np.array(state.effort, dtype=np.float64)[places])

    def read(self, now: float) -> FloatArray:
        """Return torques (n,) [Nm] by the environment on the joints, as of an instant [s]; NaN: there is no estimate.

        Where zeros are no wrench, they are no torques either: an arm that does not estimate them gives those.
        """
        ours = self._ours(now)
        return np.full(len(self._names), np.nan) if ours is None else ours
