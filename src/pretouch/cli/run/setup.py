"""Arm, units, profile and path of a run, from the command line."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from pretouch.cli.skin_keys import keys_file
from pretouch.cli.writing import check_writable
from pretouch.contact.sequential_test import SequentialTest
from pretouch.control.path import Circle, Path, WayPoints, line
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.coverage.placement import assumptions, placement_for
from pretouch.desired import Desired
from pretouch.errors import ParameterError
from pretouch.hardware.franka.limits import LimiterParams, planned
from pretouch.hardware.keys import Keys, load_keys
from pretouch.hardware.network_skin import NetworkSkin
from pretouch.loop import Recorder
from pretouch.perception.scene_filter import Fixtures, floor_and_pedestal
from pretouch.ports import Skin as SkinPort
from pretouch.profiles import Profile
from pretouch.profiles import profile as find_profile
from pretouch.robot.model import RobotModel
from pretouch.robot.named import robot_named
from pretouch.sensing.skin import Skin, skin_for
from pretouch.session.arm import Arm
from pretouch.session.confirmations import Identity, state_folder
from pretouch.session.free_motion import FreeMotion, ModelFile, model_file_of
from pretouch.session.push import Direction
from pretouch.session.terminal import say
from pretouch.session.units import Units
from pretouch.signals import children_undisturbed
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.scene import SceneSpec
from pretouch.types import FloatArray

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run, TaskOptions

_SHORTEST_M = 1e-5
"""A path must have a length: over so little an arm stands."""


@dataclass(frozen=True)
class RunSetup:
    """Arm, units and parameters; the path may need to know where the arm is."""

    model: RobotModel
    skin: Skin
    profile: Profile
    floor: float
    """Height of the floor below the arm, base frame [m]."""
    task: "TaskOptions"
    placement: Placement
    """Where the paper's paths are for the arm."""
    assumed: tuple[str, ...]
    """What of the arm and its path had to be assumed, a sentence each."""

    @property
    def fixtures(self) -> Fixtures:
        """What stands still around the arm: the floor, and what its base stands on."""
        return floor_and_pedestal(self.floor)

    def controller(self, q: FloatArray) -> Controller:
        """Return the controller for an arm that stands at q (n,) [rad]."""
        return Controller(self.model, self.skin, self.fixtures, self._path(q), self.profile)

    def simulated_start(self) -> FloatArray:
        """Joint positions (n,) [rad] at which a simulated arm begins: at its path, unless it is to go there."""
        ready = self.model.description.q_ready
        if self.task.approach or self.task.path == "hold":
            return ready
        return brought_to(self.model, self._path(ready).point(0.0))

    def _path(self, q: FloatArray) -> Path:
        """Return the path, begun where it comes nearest to an arm at q: a circle anywhere, a line at either end."""
        here = self.model.kinematics(q).position[self.model.ee]
        if self.task.path == "circle":
            usual = cast(Circle, self.placement.path("circle", 1.0))
            center = usual.center if self.task.center is None else self.task.center
            y, z = here[1:] - center[1:]
            radius = usual.radius if self.task.radius is None else self.task.radius
            return Circle(center, radius, float(np.arctan2(z, y)))
        if self.task.path == "line":
            ends = cast(WayPoints, self.placement.path("line", 1.0)).points
            return WayPoints(ends[np.argsort(np.linalg.norm(ends - here, axis=1), kind="stable")])
        x, y, z = here.tolist()
        return line((x, y, z), (x, y, z + _SHORTEST_M))


def run_setup(command: "Run") -> RunSetup:
    """Read files and parameters; what does not fit together is an error."""
    units, task, profile = command.units, command.task, find_profile(command.task.profile)
    model = RobotModel(robot_named(command.robot.arm))
    if command.robot.robot == "franka":
        model = RobotModel(planned(model.description, LimiterParams()))
    if units.no_skin:
        if profile.perception is not None:
            raise ParameterError(
                f"The profile {profile.name} needs sensor units, but there are none: choose --profile blind or"
                " pretouch:perception=none, or leave out --no-skin."
            )
        skin = Skin((), model)
    else:
        skin = skin_for(model, units.skin)
    by_torques = profile.detect.by_torques or profile.react.by_torques
    if command.robot.robot == "ros2" and by_torques and not command.robot.ros_torques:
        raise ParameterError(
            f"The profile {profile.name} detects contacts by external joint torques: give their topic by --ros-torques,"
            " or choose --profile paper, or pretouch:detect=thresholds:react=decay."
        )
    if command.robot.ros_desired:
        task = replace(task, path="hold")
    simulated = command.robot.robot == "simulated"
    floor = (SceneSpec().floor_height if simulated else 0.0) if task.floor is None else task.floor
    if not np.isfinite(floor):
        raise ParameterError(f"--floor is {floor}: give a height in metres.")
    circle = task.path == "circle" and (task.center is None or task.radius is None)
    placement = placement_for(model) if circle or task.path == "line" else Placement()
    assumed = assumptions(model, placement)
    if not simulated:  # a real arm is what it is, wherever its path is
        assumed = tuple(said for said in assumed if said == placement.paths_sentence(model.description.name))
    return RunSetup(model, skin, profile, floor, task, placement, assumed)


if TYPE_CHECKING:
    from pretouch.cli.run.options import RobotOptions


def free_motion(options: "RobotOptions", controller: Controller, robot: str) -> FreeMotion | None:
    """Find what is known of a robot's free motion, and say it; None where none is kept.

    Args:
        options: `learnt`, `learn_anew` and `no_learnt` of them.
        controller: that moves the arm.
        robot: what it is known by.
    """
    if not isinstance(controller.profile.detect, SequentialTest):
        if options.learnt or options.learn_anew:
            raise ParameterError(
                f"The profile {controller.profile.name} does not learn free motion: choose --profile pretouch, or leave"
                " out --learnt and --learn-anew."
            )
        return None
    if options.no_learnt:
        return None
    file = model_file_of(robot, state_folder())
    if options.learnt:
        file = ModelFile(robot, FilePath(options.learnt), True)
        check_writable("free-motion file", file.path)
    found = FreeMotion(file, controller, options.learn_anew)
    for sentence in found.found:
        say(sentence)
    return found


class Output(Recorder, Protocol):
    """What else is told of each control step."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of that, a sentence each."""
        ...


class Commander(Protocol):
    """Who asks for a motion in place of a path; see `loop.Options.desired`."""

    def __call__(self) -> Desired | None:
        """Return what is asked for now."""
        ...

    @property
    def announced(self) -> str:
        """Say what the arm will do, before it moves."""
        ...


def _no_output(_controller: Controller) -> AbstractContextManager[Output | None]:
    return nullcontext()


@dataclass(frozen=True)
class OpenedRobot:
    """An arm that can be read, and its units."""

    arm: Arm
    skin: SkinPort
    identity: Identity | None
    """By which its confirmed force sign is remembered; None: it is not."""
    units: Units | None = None
    """What hears the units, where their health can be told."""
    asked: Callable[[Direction], None] = lambda _: None
    """Called as a person is asked to push: a simulated one does."""
    notes: Callable[[], tuple[str, ...]] = lambda: ()
    """What is to be known of the connection by now, a sentence each."""
    output: Callable[[Controller], AbstractContextManager[Output | None]] = _no_output
    """Opens what else is told of each control step."""
    free_motion_id: str = ""
    """What the robot is known by as its free motion is remembered, where that may be learnt."""
    commander: Commander | None = None
    """Whom the arm follows, if it is not the path."""


@contextmanager
def network_units(command: "Run", setup: RunSetup, keys: Keys | None = None) -> Iterator[NetworkSkin | None]:
    """Hear the units over the network, if there are any."""
    if not len(setup.skin):
        yield None
        return
    c = command.units
    keys = load_keys(keys_file(c.keys)) if keys is None else keys
    with children_undisturbed():
        receiver = NetworkSkin(setup.skin.network, keys, c.units_host, c.units_port)
    with receiver as units:
        print(f"Receiving units at {units.address[0]}:{units.address[1]}.", flush=True)
        yield units
