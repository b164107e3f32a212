"""A ROS 2 arm as a session's, and by what its confirmed force sign is remembered."""

import numpy as np

from pretouch.errors import RobotError
from pretouch.hardware.ros2.network import domain_of
from pretouch.hardware.ros2.params import ArmParams, NodeParams
from pretouch.hardware.ros2.robot import Ros2Robot
from pretouch.session.confirmations import Identity
from pretouch.types import FloatArray, RobotState


def identity(node: NodeParams, arm: ArmParams) -> Identity:
    """Return what a robot is known by: its topics, and the settings that say what they mean."""
    where = ", ".join(filter(None, (node.interface, f"domain {domain_of(node)}", arm.wrench, arm.torques)))
    return Identity("ros2", where, f"sign {arm.sign}, frame {arm.frame}, zeros {arm.zeros}")


class Ros2SessionArm:
    """The port `Arm` over topics."""

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
            raise RobotError("The arm takes no commands yet: begin first.")
        self._robot.command(qd)

    def unfit(self) -> tuple[str, ...]:
        """Topics tell of nothing against it."""
        return ()

    def begin(self) -> None:
        """Take commands from here on, once the arm has settled where it is."""
        self._robot.begin()
        self._begun = True

    def end(self) -> None:
        """Command rest, wait until the last trajectory has ended, and take no more commands."""
        if not self._begun:
            return
        self._begun = False
        try:
            self._robot.command(self._rest)
        finally:
            self._robot.end()

    def report(self) -> str:
        """Topics have nothing to say."""
        return ""
