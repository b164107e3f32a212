"""A ROS 2 arm as a session's, and by what its confirmed force sign is remembered."""

import numpy as np

from pretouch.errors import RobotError
from pretouch.hardware.ros2.params import ArmParams, NodeParams
from pretouch.hardware.ros2.robot import Ros2Robot
from pretouch.session.remembered import Identity
from pretouch.types import FloatArray, RobotState


def identity(node: NodeParams, arm: ArmParams) -> Identity:
    """Return what a robot is known by: its topics, and the settings that say what they mean."""
    domain = "the environment's domain" if node.domain < 0 else f"domain {node.domain}"
    return Identity("ros2", f"{node.interface}, {domain}, {arm.wrench}", f"sign {arm.sign}, frame {arm.frame}")


class Ros2SessionArm:
    """The port `Arm` over topics. Whoever takes the commands must stop the arm when none come."""

    def __init__(self, robot: Ros2Robot, n: int) -> None:
        """Take a robot of n joints that is heard."""
        self._robot, self._rest, self._begun = robot, np.zeros(n), False
        self.name = "arm on ROS 2"

    def read(self) -> RobotState:
        """Return the newest state."""
        return self._robot.read()

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point."""
        if not self._begun:
            raise RobotError("No commands are given yet: begin first.")
        self._robot.command(qd)

    def unfit(self) -> tuple[str, ...]:
        """Topics tell of nothing against it."""
        return ()

    def begin(self) -> None:
        """Take commands from here on."""
        self._begun = True

    def end(self) -> None:
        """Command rest, and take no more commands."""
        if self._begun:
            self._begun = False
            self._robot.command(self._rest)

    def report(self) -> str:
        """Topics have nothing to say."""
        return ""
