"""Arm, units, profile and path of a run, from the command line."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from pretouch.arms import ArmOptions, OpenedArm
from pretouch.calibration.motion.follow import standing_at
from pretouch.cli.options import RobotOptions, SkinOptions, TaskOptions, UnitOptions
from pretouch.cli.writing import check_writable
from pretouch.contact.sequential_test import SequentialTest
from pretouch.control.path import Circle, Path, WayPoints
from pretouch.controller import Controller
from pretouch.errors import HardwareError, ParameterError
from pretouch.ports import NoUnits, SkinPort
from pretouch.profiles import Profile
from pretouch.profiles import profile as find_profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin, skin_for
from pretouch.session.memory import FreeMotion, ModelFile, model_file_of, state_folder
from pretouch.session.terminal import say
from pretouch.sim.paper_scenes import Placement, assumptions, placement_for
from pretouch.sim.scene import SceneSpec, floor_and_pedestal
from pretouch.types import FloatArray
from pretouch.units.keys import load_keys
from pretouch.units.skin import NetworkSkin


@dataclass(frozen=True)
class RunSetup:
    """Arm, units and parameters; the path may need to know where the arm is."""

    model: RobotModel
    skin: Skin
    profile: Profile
    floor: float
    """Height of the floor below the arm, base frame [m]."""
    task: TaskOptions
    placement: Placement
    """Placement of the paper's paths for the arm."""
    assumed: tuple[str, ...]
    """Assumptions on the arm and its path, a sentence each."""

    def controller(self, q: FloatArray) -> Controller:
        """Return the controller for an arm that stands at q (n,) [rad]."""
        return Controller(self.model, self.skin, floor_and_pedestal(self.floor), self._path(q), self.profile)

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
            x, y, z = self.task.center or usual.center
            radius = usual.radius if self.task.radius is None else self.task.radius
            return Circle((x, y, z), radius, float(np.arctan2(here[2] - z, here[1] - y)))
        if self.task.path == "line":
            ends = cast(WayPoints, self.placement.path("line", 1.0)).points
            return WayPoints(ends[np.argsort(np.linalg.norm(ends - here, axis=1), kind="stable")])
        return standing_at(here)


def run_setup(arm: ArmOptions, robot: RobotOptions, units: SkinOptions, task: TaskOptions) -> RunSetup:
    """Read files and parameters; what does not fit together is an error."""
    profile = find_profile(task.profile)
    model = RobotModel(arm.described(robot_named(robot.arm, robot.gravity)))
    if units.no_skin:
        if profile.perception is not None:
            raise ParameterError(
                f"The profile {profile.name} needs sensor units, but there are none: choose --profile blind or"
                " pretouch:perception=none, or leave out --no-skin."
            )
        skin = Skin((), model)
    else:
        skin = skin_for(model, units.skin, paper=profile.sight.memory is None)
    if arm.commanded:
        task = replace(task, path="hold")
    floor = (SceneSpec().floor_height if arm.simulated else 0.0) if task.floor is None else task.floor
    if not np.isfinite(floor):
        raise ParameterError(f"--floor is {floor}: give a height in metres.")
    if len(task.center) not in (0, 3) or not np.isfinite(task.center).all():
        raise ParameterError(f"--center is {','.join(map(str, task.center))}: give x,y,z in metres, as 0.5,0,0.4.")
    circle = task.path == "circle" and not (task.center and task.radius is not None)
    placement = placement_for(model) if circle or task.path == "line" else Placement()
    assumed = assumptions(model, placement)
    if not arm.simulated:  # a real arm is what it is, wherever its path is
        paths = placement.paths_sentence(model.description.name)
        assumed = tuple(sentence for sentence in assumed if sentence == paths)
    return RunSetup(model, skin, profile, floor, task, placement, assumed)


def free_motion(options: RobotOptions, controller: Controller, robot: str) -> FreeMotion | None:
    """Read the learnt free motion of a robot, and print it; None where none is remembered.

    `options` are `learnt` and `no_learnt`; `robot` is the name that it is remembered by.
    """
    if not isinstance(controller.profile.detect, SequentialTest):
        if options.learnt:
            raise ParameterError(
                f"The profile {controller.profile.name} does not learn free motion: choose --profile pretouch, or leave"
                " out --learnt."
            )
        return None
    if options.no_learnt:
        return None
    file = model_file_of(robot, state_folder())
    if options.learnt:
        file = ModelFile(robot, options.learnt, True)
        check_writable("free-motion file", file.path)
    motion = FreeMotion(file, controller)
    say(motion.sentence)
    return motion


@contextmanager
def heard_units(where: UnitOptions, skin: Skin, opened: OpenedArm) -> Iterator[SkinPort]:
    """Hear the units of a skin: over the network where there are keys, or else those that the arm brings."""
    with ExitStack() as stack:
        units: SkinPort | None = opened.skin if len(skin) else NoUnits()
        if len(skin) and where.keys:
            receiver = NetworkSkin(skin.network, load_keys(where.keys), where.units_host, where.units_port)
            units = stack.enter_context(receiver)
        if units is None:
            raise HardwareError(f"{opened.arm.name} brings no sensor units: give the file of their keys with --keys.")
        if isinstance(units, NetworkSkin):
            say(f"Receiving units at {units.address[0]}:{units.address[1]}.")
        yield units
