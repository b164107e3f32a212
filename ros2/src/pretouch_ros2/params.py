"""Settings of a connection to ROS 2: what no topic says of itself, and which topics."""

import math
import re
from dataclasses import dataclass
from typing import Annotated, Literal

from pretouch.checks import Check, Checked
from pretouch.errors import ParameterError

Distribution = Literal["foxy", "galactic", "humble", "iron", "jazzy", "kilted", "lyrical"]
Sign = Literal["on-robot", "by-robot"]
Frame = Literal["base", "ee"]
Zeros = Literal["auto", "missing", "kept"]
Command = Literal["twist", "trajectory"]

LOOPBACK = "127.0.0.1"
ENVIRONMENT = "environment"
"""The interface that leaves the network to Cyclone DDS and its CYCLONEDDS_URI."""
_TOPIC = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)


@dataclass(frozen=True)
class NodeParams(Checked):
    """Settings that reach other nodes."""

    distribution: Distribution = "jazzy"
    """Release of ROS 2 of the others: sensor_msgs/Range is not the same before Iron and since."""
    domain: Annotated[int, Check(low=-1, high=232)] = -1
    """Domain; -1: what ROS_DOMAIN_ID says, or else 0."""
    interface: str = LOOPBACK
    """Network to use, by the address or the name of this machine's interface: by default this machine alone.
    `environment`: what CYCLONEDDS_URI says, or else what Cyclone DDS chooses."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not re.fullmatch(r"[\w.:%-]+", self.interface, re.ASCII):
            raise ParameterError(
                f"NodeParams.interface is {self.interface!r}: give an address or name of an interface of this machine."
            )


@dataclass(frozen=True)
class ArmParams(Checked):
    """An arm behind topics."""

    sign: Sign
    """Sign of the wrench: on the robot by the environment, as ours, or by the robot, as Franka's O_F_ext_hat_K."""
    frame: Frame
    """Frame the wrench is given in: the arm's base or its end-effector."""
    zeros: Zeros = "auto"
    """Meaning of a wrench of six zeros: no estimate, or no force; auto: no estimate where the force is by the robot."""
    joint_states: str = "/joint_states"
    """Topic of sensor_msgs/JointState."""
    joint_names: tuple[str, ...] = ()
    """The arm's joints as the messages and the arm's controller call them, in the model's order; () is the model's."""
    wrench: str = "/wrench"
    """Topic of geometry_msgs/WrenchStamped."""
    torques: str = ""
    """Topic of sensor_msgs/JointState whose efforts are external joint torques, of the wrench's sign; '': none."""
    wrench_timeout_s: Annotated[float, Check(low=0.0, high=0.5, open_low=True)] = 0.05
    """Age of a wrench, and of torques, from which they are no estimate any more [s]."""
    shared_clock: bool = True
    """True if the time of ROS is this machine's time of day, to some milliseconds: then stamps of headers count, and
    trajectories say when they begin. Otherwise what counts is when a message comes, and the arm moves smoothly by
    joint_trajectory_controller 4.17 to 4.20 alone."""
    command_topic: str = "/joint_trajectory_controller/joint_trajectory"
    """Topic of the commands, trajectory_msgs/JointTrajectory that end at rest."""
    hold_s: Annotated[float, Check(low=0.0, high=0.5, open_low=True)] = 0.05
    """Time at the commanded velocity before a trajectory brakes, if no other one comes [s]."""
    ahead_s: Annotated[float, Check(low=0.0, high=0.05)] = 0.01
    """With one clock: how long after a turn of the loop its trajectory begins [s]. A message that takes no longer, less
    a period of the arm's controller, leaves no trace in the motion."""
    settle_s: Annotated[float, Check(low=0.2, high=5.0)] = 0.5
    """Time in which the first trajectory brings the arm to where it was measured [s]: what its controller commanded by
    then is not known. Until then only rest is commanded."""
    follow_most_rad: Annotated[float, Check(low=0.005, high=0.3)] = 0.05
    """Distance between a joint's commanded and measured position from which the arm does not follow [rad]."""
    stray_rad: Annotated[float, Check(low=0.001, high=0.1)] = 0.005
    """Distance between a joint and where it usually is by its commands, its lag and offset known, from which its
    controller is taken to be elsewhere: it is left to come to rest, and begins anew where it then is [rad]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("joint_states", "wrench", "command_topic"):
            check_topic("ArmParams", name, getattr(self, name))
        if self.torques:
            check_topic("ArmParams", "torques", self.torques)
        if len(set(self.joint_names)) < len(self.joint_names):
            raise ParameterError(f"ArmParams.joint_names is {', '.join(self.joint_names)}: name each joint once.")

    @property
    def zeros_missing(self) -> bool:
        """True if a wrench of only zeros means no measurement."""
        return self.zeros == "missing" or (self.zeros == "auto" and self.sign == "by-robot")


def check_topic(owner: str, name: str, topic: str) -> None:
    """Refuse what ROS 2 does not take as the full name of a topic: a ParameterError."""
    if not _TOPIC.fullmatch(topic) or not topic.startswith("/"):
        raise ParameterError(
            f"{owner}.{name} is {topic!r}: give the full name of a topic, such as /arm/joint_states (letters, digits"
            " and underscores between slashes, no part starting with a digit)."
        )


def seconds(sec: int, nanosec: int) -> float:
    """Return a ROS time or duration [s]."""
    return sec + nanosec / 1e9


def parts(duration: float) -> tuple[int, int]:
    """Return a time or duration [s] as whole seconds and nanoseconds."""
    nanoseconds = math.floor(duration * 1e9 + 0.5)
    return nanoseconds // 10**9, nanoseconds % 10**9
