"""What can be said after `pretouch run`."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Generic, Literal, TypeVar, Union

import tyro

from pretouch.arms import ArmOptions, arm_class, arm_names
from pretouch.cli.options import JsonFile, OptionalFile, split_arm
from pretouch.errors import HardwareError, ParameterError, RobotError
from pretouch.units.udp import HOST, PORT

A = TypeVar("A", bound=ArmOptions)


@dataclass(frozen=True)
class RobotOptions:
    """The arm's model, and what is remembered of it."""

    arm: str = "panda"
    """Model of the arm: panda, fr3, or the folder of an imported arm."""
    confirm_push: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Ask for the guided pushes even if the force sign of this robot is confirmed."""
    learnt: OptionalFile = None
    """File of the arm's free-motion model, loaded at the start and saved at the end; by default one file per robot."""
    learn_anew: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start without a free-motion model, and replace the saved one by what this run learns."""
    no_learnt: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Start without a free-motion model, and save none."""


@dataclass(frozen=True)
class UnitOptions:
    """Where the sensor units are heard."""

    keys: OptionalFile = None
    """File of the keys of units that are received over the network; without it, the units that the arm brings."""
    units_host: str = HOST
    """Address to receive units at; real ones need 0.0.0.0, which is every address of this machine."""
    units_port: int = PORT
    """UDP port to receive units at."""

    def check(self) -> None:
        """Refuse an address that is none: a HardwareError."""
        if not self.units_host:
            raise HardwareError("--units-host is empty: give 127.0.0.1, or 0.0.0.0 for every address of this machine.")


@dataclass(frozen=True)
class SkinOptions(UnitOptions):
    """The sensor units."""

    skin: OptionalFile = None
    """Skin file; by default the seven units that come with the package."""
    no_skin: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The arm carries no units. The profile must not need any, such as blind."""


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
class Run(Generic[A]):
    """Move an arm: checks, a guided push that confirms the force sign, the controller in real time, and rest.

    `pretouch run` and `pretouch run simulated` rehearse. `pretouch run NAME` moves another arm, with options of its
    own: franka, ros2 of the distribution pretouch-ros2, or one that another distribution adds.
    The exit code is 1 if the run ended early or its recording failed, 2 if it was refused before anything moved.
    """

    connection: A
    robot: RobotOptions = field(default_factory=RobotOptions)
    units: SkinOptions = field(default_factory=SkinOptions)
    task: TaskOptions = field(default_factory=TaskOptions)
    record: OptionalFile = None
    """Recording to write."""
    json: JsonFile = None
    holds: str = "runs/holds"
    """Folder for the last seconds before a HOLD that lasts until a person resumes."""
    priority: int | None = None
    """Real-time priority of the control loop, 1 to 99; by default the process keeps its own."""
    cpu: int | None = None
    """Processor to run on; by default the system decides."""
    yes: bool = False
    """Do not ask before the arm moves."""

    @staticmethod
    def of_words(words: Sequence[str]) -> tuple[Any, Sequence[str], str]:
        """Return the command for the arm that the first word names, the other words, and what is in front of them."""
        name, others = split_arm(words)
        return Run[arm_class(name)], others, f"run {name}" if len(others) < len(words) else "run"  # type: ignore[misc]

    @staticmethod
    def of_all() -> Any:
        """Return the command with all arms as words that follow it."""
        arms = [Annotated[arm_class(name), tyro.conf.subcommand(name)] for name in arm_names()]
        return Run[Union[tuple(arms)]]  # type: ignore[misc]  # noqa: UP007  # made when it is asked for

    def run(self) -> int | None:
        """Move the arm. Where a signal ended the run in order, its code is the exit code."""
        from pretouch.cli.run.command import run
        from pretouch.cli.writing import numbers_to

        check_options(self)
        with numbers_to(self.json) as write:
            return run(self, write) or None


def check_options(command: Run[Any]) -> None:
    """Raise an error for options that cannot be combined."""
    robot, units, arm = command.robot, command.units, command.connection
    if units.no_skin and (units.skin or units.keys):
        raise HardwareError("--no-skin does not go with --skin and --keys: leave one or the other out.")
    if not (units.no_skin or units.keys or arm.brings_units):
        raise HardwareError("The arm brings no sensor units: give the file of their keys with --keys, or --no-skin.")
    if robot.no_learnt and (robot.learnt or robot.learn_anew):
        raise RobotError("--no-learnt does not go with --learnt and --learn-anew: leave one or the other out.")
    units.check()
    if not 0.0 <= command.task.seconds < float("inf"):
        raise ParameterError(f"--seconds is {command.task.seconds:g}: give 0 or more.")
