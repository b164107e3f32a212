"""What a run is made of, from what was said on the command line."""

from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

import numpy as np

from pretouch.cli.arms import arm_model
from pretouch.control.path import Circle, Path, line
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.errors import ParameterError
from pretouch.hardware.franka.limits import LimiterParams, planned
from pretouch.perception.scene_filter import Fixtures, floor_and_pedestal
from pretouch.profiles import Profile
from pretouch.profiles import profile as find_profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, load_skin, paper_skin
from pretouch.sim.scene import SceneSpec
from pretouch.types import FloatArray

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run, TaskOptions

_LINE = ((0.4, -0.5, 0.5), (0.4, 0.5, 0.5))
_SHORTEST_M = 1e-5
"""A path must have a length: over so little an arm stands."""


@dataclass(frozen=True)
class Parts:
    """Arm, units and parameters; the path may need to know where the arm is."""

    model: RobotModel
    skin: Skin
    profile: Profile
    floor: float
    """Height of what is below the arm, base frame [m]."""
    task: "TaskOptions"

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
            y, z = here[1:] - self.task.center[1:]
            return Circle(self.task.center, self.task.radius, float(np.arctan2(z, y)))
        if self.task.path == "line":
            return line(*sorted(_LINE, key=lambda end: float(np.linalg.norm(end - here))))
        x, y, z = here.tolist()
        return line((x, y, z), (x, y, z + _SHORTEST_M))


def parts(command: "Run") -> Parts:
    """Read files and parameters; what does not fit together is an error."""
    units, task, profile = command.units, command.task, find_profile(command.task.profile)
    model = arm_model(command.robot.arm)
    if command.robot.robot == "franka":
        model = RobotModel(planned(model.description, LimiterParams()))
    if units.no_skin:
        if profile.perception.enabled:
            raise ParameterError(
                f"The profile {profile.name} needs sensor units, and there are none: choose --profile blind or"
                " pretouch:perception.enabled=no, or leave out --no-skin."
            )
        skin = Skin((), model)
    else:
        skin = load_skin(FilePath(units.skin), model) if units.skin else paper_skin(model)
    by_torques = profile.detect.by_torques or profile.react.by_torques
    if command.robot.robot == "ros2" and by_torques:
        raise ParameterError(
            f"The profile {profile.name} feels contacts by external joint torques, and ROS 2 has no message for them:"
            " choose --profile paper, or pretouch:detect=thresholds:react=decay."
        )
    simulated = command.robot.robot == "simulated" or command.robot.lockstep
    floor = (SceneSpec().floor_height if simulated else 0.0) if task.floor is None else task.floor
    if not np.isfinite(floor):
        raise ParameterError(f"--floor is {floor}: give a height in metres.")
    return Parts(model, skin, profile, floor, task)
