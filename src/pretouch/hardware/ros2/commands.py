"""What sends commands to an arm's controller, and the plain way: velocities."""

import math
from typing import Protocol

import numpy as np

from pretouch.hardware.ros2.joints import Measured
from pretouch.hardware.ros2.messages import VELOCITIES
from pretouch.hardware.ros2.node import Publisher, Ros2Node
from pretouch.hardware.ros2.params import ArmParams
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray


class CommandSender(Protocol):
    """Sends joint velocities, and reckons where the arm is asked to be."""

    publisher: Publisher

    @property
    def begun(self) -> bool:
        """Whether commands are sent."""
        ...

    @property
    def ends(self) -> float:
        """When the arm is at rest if nothing more is sent [s]; -inf if that is not known or was long ago."""
        ...

    def begin(self, joints: Measured, now: float) -> float:
        """Begin at rest where the arm is; return how long that takes [s]."""
        ...

    def send(self, qd: FloatArray, now: float) -> None:
        """Send velocities (n,) [rad/s], which count from an instant on [s]."""
        ...

    def at(self, joints: Measured, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return the commanded positions and velocities (n,) at an instant [s]."""
        ...

    def check(self, joints: Measured, now: float) -> None:
        """Look whether the arm is where it was sent; RobotError if it is not."""
        ...

    def rest(self) -> None:
        """Send what brings the arm to rest, if that needs anything."""
        ...


class VelocityCommands:
    """Sends std_msgs/Float64MultiArray. That its controller stops when none comes cannot be known."""

    ends = -math.inf

    def __init__(self, params: ArmParams, model: RobotModel, node: Ros2Node) -> None:
        """Take what to send, the arm and the node."""
        self.publisher = node.publisher(params.commands_on, VELOCITIES)
        self._make, self._sent, self.begun = node.messages.make, np.zeros(model.n), False

    def begin(self, joints: Measured, now: float) -> float:
        """Nothing has to be sent."""
        self.begun = True
        return 0.0

    def send(self, qd: FloatArray, now: float) -> None:
        """Send velocities (n,) [rad/s]."""
        self._sent = np.array(qd, dtype=np.float64)
        self.publisher.publish(self._make(VELOCITIES, self._make("std_msgs/msg/MultiArrayLayout", [], 0), self._sent))

    def at(self, joints: Measured, instant: float) -> tuple[FloatArray, FloatArray]:
        """Return the measured positions and the last command."""
        return joints.q, self._sent

    def check(self, joints: Measured, now: float) -> None:
        """Nothing says where the arm should be."""

    def rest(self) -> None:
        """Send zeros."""
        if self.begun:
            self.send(np.zeros_like(self._sent), 0.0)
