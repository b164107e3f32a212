"""External joint torques: of our joints, in our order and sign, or NaN where there is no estimate."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from pretouch.types import FloatArray
from pretouch_ros2.messages import FRANKA_STATE, JOINT_STATE
from pretouch_ros2.params import ArmParams
from pretouch_ros2.stamps import Stamps

_NAMES_MOST = 1000
"""Joints of a message; one with more is nobody's whose joints are ours."""


class JointTorques:
    """Takes in sensor_msgs/JointState, or the one in franka_msgs/FrankaRobotState, whose efforts they are."""

    def __init__(self, params: ArmParams, names: Sequence[str], stamps: Stamps) -> None:
        self._params, self._names, self.stamps = params, tuple(names), stamps
        self._newest: tuple[float, FloatArray] | None = None
        self.others: tuple[str, ...] = ()
        """Joints named in the newest message that was not of all of ours; some of them, where there are many."""

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
        if len(state.name) > _NAMES_MOST:
            return
        places = {name: i for i, name in enumerate(state.name)}
        if len(state.effort) != len(state.name) or not all(name in places for name in self._names):
            self.others = tuple(state.name[:9])
            return
        stamp = self.stamps.instant(message.header, received, writer)
        if stamp is not None:
            efforts = np.array(state.effort, dtype=np.float64)
            self._newest = stamp, efforts[[places[name] for name in self._names]]

    def read(self, now: float) -> FloatArray:
        """Return torques (n,) [Nm] by the environment on the joints, as of an instant [s]; NaN: there is no estimate.

        Where zeros are no wrench, they are no torques either: an arm that does not estimate them gives those.
        """
        if self._newest is None:
            return np.full(len(self._names), np.nan)
        stamp, given = self._newest
        absent = self._params.zeros_missing and not given.any()
        if absent or now - stamp > self._params.wrench_timeout_s:
            return np.full(len(self._names), np.nan)
        return -given if self._params.sign == "by-robot" else given.copy()
