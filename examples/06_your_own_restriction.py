"""A restriction of your own: speed and separation, as a class and an entry in a profile.

    python examples/06_your_own_restriction.py

No point of the arm comes nearer to an object faster than it could stop in time, as seen by the skin. Put the class in a
package of yours with an entry point of the group `pretouch.restrictions`, and `paper:approach=separation` works in
every command.
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
    """An approach no faster than leaves `reach_s` of time before `keep_m` is reached."""

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
        """Return a row for each obstacle: how fast its closest point of the body approaches, and may."""
        model, points = body.model, zip(near.link, near.body_point, near.direction, strict=True)
        rows = [direction @ model.jacobian(kin, int(link), point)[:3] for link, point, direction in points]
        limit = np.maximum(near.body_distance - self.keep_m, 0.0) / self.reach_s
        return Restricted(np.reshape(rows, (-1, model.n)), limit, np.arange(len(limit)), weight=1000.0), state


class Nearest:
    """A recorder that keeps how near the arm comes to the board, and how fast it is there."""

    def __init__(self) -> None:
        self.distance, self.speed = np.inf, 0.0

    def record(self, cycle: pt.Cycle) -> None:
        """Look at one step."""
        o, step = cycle.step.obstacles, cycle.step
        if o.body_distance.min(initial=np.inf) < self.distance:
            self.distance, self.speed = float(o.body_distance.min()), float(np.linalg.norm(step.ee_velocity))


def main() -> None:
    """Follow a line into a board for six seconds, with the profile's own restriction left out and with this one."""
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
