"""A restriction of your own in a profile: speed and separation, as a class.

    python examples/06_your_own_restriction.py

It limits the speed of each point of the arm towards a sensed object, so that the arm can stop in time. With an entry
point of the group `pretouch.restrictions` in a package of yours, `paper:approach=separation` works in every command.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import pretouch as pt
from pretouch.control.approach import MotionBody, MotionRequest, Restricted, Restriction
from pretouch.loop import run
from pretouch.profiles import profile
from pretouch.robot.kinematics import Kinematics
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, SceneSpec


@dataclass(frozen=True)
class Separation(Restriction, name="separation"):
    """Limits the approach so that a point takes at least `reach_s` to the distance `keep_m`."""

    keep_m: float = 0.1
    reach_s: float = 0.5

    def step(
        self,
        state: Any,
        body: MotionBody,
        kin: Kinematics,
        robot: pt.RobotState,
        near: pt.Obstacles,
        request: MotionRequest,
    ) -> tuple[Restricted, Any]:
        """Return a row and a limit for each obstacle: speed of the body's closest point towards it."""
        model, points = body.model, zip(near.link, near.body_point, near.direction, strict=True)
        rows = [direction @ model.jacobian(kin, int(link), point)[:3] for link, point, direction in points]
        limit = np.maximum(near.body_distance - self.keep_m, 0.0) / self.reach_s
        return Restricted(np.reshape(rows, (-1, model.n)), limit, np.arange(len(limit)), weight=1000.0), state


class Nearest:
    """A recorder of the least distance to the board, and of the speed there."""

    def __init__(self) -> None:
        self.distance, self.speed = np.inf, 0.0

    def record(self, cycle: pt.Cycle) -> None:
        """Compare one step with the nearest so far."""
        o, step = cycle.step.obstacles, cycle.step
        if o.body_distance.min(initial=np.inf) < self.distance:
            self.distance, self.speed = float(o.body_distance.min()), float(np.linalg.norm(step.ee_velocity))


def main() -> None:
    """Follow a line into a board for six seconds, without a restriction and with this one."""
    model = pt.RobotModel(pt.panda())
    ready = model.kinematics(model.description.q_ready).position[model.ee]
    path = pt.segment(tuple(ready), tuple(ready + np.array([0.0, 0.4, 0.0])))
    board = Box("board", center=(ready[0], ready[1] + 0.45, ready[2]), half_size=(0.2, 0.02, 0.2), stiffness=25_000.0)
    skin = pt.paper_skin(model)
    for part in (None, Separation()):
        settings = replace(profile("paper"), slow=None, approach=part)
        arm = Plant(model, SceneSpec(boxes=(board,)), PlantParams(), model.description.q_ready, seed=1)
        units = RangeFinders(arm, skin, RangeFinderParams(), seed=1)
        nearest = Nearest()
        controller = pt.Controller(model, skin, pt.no_fixtures(), path, settings)
        clock = PlantClock(arm, settings.task.control_period_s)
        run(controller, arm, units, clock, nearest, lambda step: step.stamp > 6.0)
        name = "no restriction" if part is None else "separation"
        print(f"{name}: nearest {1000 * nearest.distance:.0f} mm, at {nearest.speed:.2f} m/s")


if __name__ == "__main__":
    main()
