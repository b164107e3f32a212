"""An arm that follows its commands exactly, under a controller."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch.control.path import Circle, Path, segment
from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES, Profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, Inputs, RangeReadings, RangeStatus, RobotState

DT = 0.01
PAPER = PROFILES["paper"]
SHORT = replace(PAPER, window=replace(PAPER.window, samples=5))
"""The paper's profile, with a window that is soon full."""


def controller_of(model: RobotModel, skin: Skin, profile: Profile = SHORT, path: Path | None = None) -> Controller:
    """A controller of an arm without fixtures, on a circle unless it is given another path."""
    return Controller(model, skin, no_fixtures(), path or Circle(), profile)


class Arm:
    """An arm that does exactly what it is told, its controller, and what both are given."""

    def __init__(self, model: RobotModel, skin: Skin, profile: Profile = PAPER, path: Path | None = None) -> None:
        self.model, self.skin = model, skin
        self.q, self.qd, self.time = model.description.q_ready.copy(), np.zeros(7), 0.0
        x = self.ee()
        path = path or segment(tuple(x), (x[0], x[1] + 0.4, x[2]))
        self.controller = controller_of(model, skin, profile, path)
        self.state = self.controller.init(self.robot())

    def ee(self) -> np.ndarray:
        return self.model.kinematics(self.q).position[self.model.ee]

    def robot(self, force: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> RobotState:
        wrench = np.array([*force, 0.0, 0.0, 0.0])
        # a push at the end-effector's origin is felt in the joints too
        tau = self.model.ee_jacobian(self.model.kinematics(self.q)).T @ wrench if any(force) else np.zeros(7)
        return RobotState(self.time, self.q, self.qd, self.q, self.qd, tau, wrench)

    def readings(self, seen: dict[int, float] | None = None, silent: dict[int, float] | None = None) -> RangeReadings:
        """Fresh readings without a target, but for the distances `seen` and the ages `silent` of some units."""
        k = len(self.skin)
        stamp, distance, status = np.full(k, self.time), np.zeros(k), np.full(k, int(RangeStatus.SIGNAL))
        for unit, d in (seen or {}).items():
            distance[unit], status[unit] = d, RangeStatus.OK
        for unit, age in (silent or {}).items():
            stamp[unit] = self.time - age
        return RangeReadings(stamp, distance, status)

    def turn(
        self,
        force: tuple[float, float, float] = (0.0, 0.0, 0.0),
        seen: dict[int, float] | None = None,
        silent: dict[int, float] | None = None,
        resume: bool = False,
        change: Callable[[RobotState], RobotState] = lambda robot: robot,
        **more: object,
    ) -> Cycle:
        """Turn the controller once and follow its command; `more` are other fields of the inputs."""
        return self.give(Inputs(self.time, change(self.robot(force)), self.readings(seen, silent), resume, **more))

    def give(self, inputs: Inputs) -> Cycle:
        """Turn the controller once with these inputs, and follow its command."""
        before = self.state
        step, self.state = self.controller.step(before, inputs)
        self.qd, self.q, self.time = step.command, self.q + step.command * DT, self.time + DT
        return Cycle(inputs, before, step, self.state)

    def step(self, *values: object, **given: object) -> ControlStep:
        return self.turn(*values, **given).step

    def run(self, cycles: int, **given: object) -> list[ControlStep]:
        return [self.step(**given) for _ in range(cycles)]


def on_its_way(model: RobotModel, skin: Skin, profile: Profile = PAPER) -> Arm:
    """An arm on its way along its path at full speed."""
    arm = Arm(model, skin, profile)
    arm.run(150)
    return arm
