"""What can be said after `pretouch run`, and which of it goes together."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Literal, cast

import tyro

from pretouch.errors import HardwareError, ParameterError, RobotError
from pretouch.hardware.address import HOST, PORT

if TYPE_CHECKING:
    from pretouch.hardware.franka.client import Kind


@dataclass(frozen=True)
class RobotOptions:
    """The arm."""

    robot: Literal["simulated", "franka", "ros2"] = "simulated"
    """simulated: a rehearsal without hardware. franka: over the Franka Control Interface. ros2: over topics."""
    arm: str = "panda"
    """Model of the arm: panda, fr3, or, but for franka, a name that another package adds or the folder of an imported
    arm."""
    ip: str = ""
    """Address of the Franka robot."""
    confirm_push: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Ask for the guided pushes even if the force sign of this robot is confirmed."""
    learnt: str = ""
    """File of the arm's free-motion model, loaded at the start and saved at the end; by default one file per robot."""
    learn_anew: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start without a free-motion model, and replace the saved one by what this run learns."""
    no_learnt: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start without a free-motion model, and save none."""
    recover: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """With franka: first recover an arm that has stopped by itself, once it is free of what it touched."""
    ros_sign: Literal["", "on-robot", "by-robot"] = ""
    """With ros2, required: whether the wrench topic gives the force on the robot or by the robot."""
    ros_frame: Literal["", "base", "ee"] = ""
    """With ros2, required: the frame of the wrench."""
    ros_own_clock: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """With ros2: ROS time differs from this machine's time of day, as in a simulation or on another machine."""
    ros_joint_states: str = "/joint_states"
    """With ros2: topic of the joint states."""
    ros_joints: tuple[str, ...] = ()
    """With ros2: names of the joints in the messages; by default the arm's own."""
    ros_wrench: str = "/wrench"
    """With ros2: topic of the wrench."""
    ros_torques: str = ""
    """With ros2: topic of external joint torques, which the profile pretouch needs: joint states, or a robot_state."""
    ros_desired: Literal["", "twist", "trajectory"] = ""
    """With ros2: the arm follows a commander in place of a path: a TwistStamped, or the velocities of a
    JointTrajectory."""
    ros_desired_topic: str = ""
    """With ros2: its topic; by default /pretouch/twist or /pretouch/joint_trajectory."""
    ros_base_frame: str = ""
    """With ros2: name of the base frame, beside the model's own."""
    ros_commands: str = "/joint_trajectory_controller/joint_trajectory"
    """With ros2: topic of the commands."""
    ros_ranges: str = "/skin/{unit}/range"
    """With ros2: topic of the units' ranges; {unit} stands for the id of each."""
    ros_distribution: Literal["foxy", "galactic", "humble", "iron", "jazzy", "kilted", "lyrical"] = "jazzy"
    """With ros2: the distribution, which determines the layout of ranges."""
    ros_domain: int = -1
    """With ros2: the domain; by default that of ROS_DOMAIN_ID."""
    ros_interface: str = "127.0.0.1"
    """With ros2: the network interface's address."""

    @property
    def kind(self) -> "Kind":
        """Which Franka arm it is; `check_options` has made sure that it is one."""
        return cast("Kind", self.arm)


@dataclass(frozen=True)
class SkinOptions:
    """The sensor units."""

    skin: str = ""
    """Skin file; by default the seven units that come with the package."""
    no_skin: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The arm carries no units. The profile must not need any, such as blind."""
    keys: str = ""
    """File of the units' keys; a simulated arm needs none."""
    units_host: str = HOST
    """Address to receive units at; real ones need 0.0.0.0, which is every address of this machine."""
    units_port: int = PORT
    """UDP port to receive units at."""


@dataclass(frozen=True)
class TaskOptions:
    """What the arm does."""

    path: Literal["circle", "line", "hold"] = "circle"
    """circle and line: the paper's paths, started at the nearest point. hold: stay in place, and yield when touched."""
    center: tuple[float, float, float] | None = None
    """Centre of the circle [m], base frame; by default 0.5 0 0.25, for an imported arm where it reaches."""
    radius: float | None = None
    """Radius of the circle [m]; by default 0.25, for an imported arm scaled by its reach."""
    profile: str = "pretouch"
    """Parameters of the controller, or PROFILE:GROUP.FIELD=VALUE."""
    seconds: float = 0.0
    """Duration [s]; 0: until it is stopped."""
    approach: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """First move slowly to the start of the path."""
    floor: float | None = None
    """Height of the floor below the arm, base frame [m]; by default 0, level with its base, and -0.2 in simulation."""


@dataclass(frozen=True)
class Run:
    """Move an arm: checks, a guided push that confirms the force sign, the controller in real time, and rest.

    The exit code is 1 if the run ended early or its recording failed, 2 if it was refused before anything moved.
    """

    robot: RobotOptions = field(default_factory=RobotOptions)
    units: SkinOptions = field(default_factory=SkinOptions)
    task: TaskOptions = field(default_factory=TaskOptions)
    record: str = ""
    """Recording to write."""
    json: str = ""
    """File for the numbers at the end, or - for standard output: text then goes to standard error."""
    holds: str = "runs/holds"
    """Folder for the last seconds before a HOLD that lasts until a person resumes."""
    priority: int | None = None
    """Real-time priority of the control loop, 1 to 99; by default the process keeps its own."""
    cpu: int | None = None
    """Processor to run on; by default the system decides."""
    seed: int = 0
    """Seed of everything that is random in a simulation."""
    yes: bool = False
    """Do not ask before the arm moves."""

    def run(self) -> int | None:
        """Move the arm. Where a signal ended the run in order, its code is the exit code."""
        from pretouch.cli.run.command import run
        from pretouch.cli.writing import numbers_to

        check_options(self)
        with numbers_to(self.json) as write:
            return run(self, write) or None


def check_options(command: Run) -> None:
    """Raise an error for options that cannot be combined."""
    robot, units, kind = command.robot, command.units, command.robot.robot
    if kind == "franka" and not robot.ip:
        raise RobotError("The robot's address is missing: give it with --ip.")
    if kind == "franka" and robot.arm not in ("panda", "fr3"):
        raise RobotError(
            f"--arm {robot.arm} does not go with --robot franka, which is a panda or an fr3: rehearse it with"
            " --robot simulated, or connect it by --robot ros2."
        )
    odd = [_flag(name) for other, names in _ONLY.items() if other != kind for name in names if _given(robot, name)]
    if odd:
        raise RobotError(f"{', '.join(odd)} {'does' if len(odd) == 1 else 'do'} not go with --robot {kind}.")
    if kind == "ros2" and not (robot.ros_sign and robot.ros_frame):
        raise RobotError(
            "--robot ros2 needs both --ros-sign and --ros-frame, because a ROS 2 wrench does not say whose force it is:"
            " see the documentation of your robot's driver."
        )
    if kind == "ros2" and command.task.approach:
        raise RobotError(
            "--approach does not go with --robot ros2, where nobody has tried it: guide the arm by hand to the start of"
            " its path."
        )
    if robot.ros_desired_topic and not robot.ros_desired:
        raise RobotError("--ros-desired-topic needs --ros-desired, which says what is asked there: give both.")
    if units.no_skin and (units.skin or units.keys):
        raise HardwareError("--no-skin does not go with --skin and --keys: leave one or the other out.")
    if robot.no_learnt and (robot.learnt or robot.learn_anew):
        raise RobotError("--no-learnt does not go with --learnt and --learn-anew: leave one or the other out.")
    if not units.units_host:
        raise HardwareError("--units-host is empty: give 127.0.0.1, or 0.0.0.0 for every address of this machine.")
    if not 0.0 <= command.task.seconds < float("inf"):
        raise ParameterError(f"--seconds is {command.task.seconds:g}: give 0 or more.")
    if command.seed < 0:
        raise ParameterError(f"The seed is {command.seed}: it must be at least 0.")


_ONLY = {
    "franka": ("ip", "recover"),
    "ros2": (
        "ros_sign", "ros_frame", "ros_own_clock", "ros_joint_states",
        "ros_joints", "ros_wrench", "ros_torques", "ros_commands", "ros_ranges", "ros_distribution", "ros_domain",
        "ros_interface", "ros_desired", "ros_desired_topic", "ros_base_frame",
    ),
}  # fmt: skip
"""Options that only one kind of robot has."""


def _given(robot: RobotOptions, name: str) -> bool:
    return bool(getattr(robot, name) != getattr(RobotOptions(), name))


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"
