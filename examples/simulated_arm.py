"""A simulated Panda with seven sensor units follows a circle, and a board stands in its way. Prints what the arm does.

    python examples/simulated_arm.py

Use your own skin with `load_skin(Path("my_skin.toml"), model)`, your own path with `WayPoints`, and your own parameters
with `dataclasses.replace`.
"""

from dataclasses import replace

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.explanation import explain
from pretouch.loop import Cycle, run
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, SceneSpec, fixtures


class Narrator:
    """A recorder that prints each new activity of the arm."""

    def __init__(self, units: tuple[str, ...], links: tuple[str, ...]) -> None:
        self._names, self._doing = (units, links), ""

    def record(self, cycle: Cycle) -> None:
        """Print the first step of an activity."""
        explanation = explain(cycle.step, *self._names)
        if explanation.doing.value != self._doing:
            self._doing = explanation.doing.value
            print(f"{cycle.step.stamp:6.2f} s  {self._doing:10}  {explanation.sentence}")


def main() -> None:
    """Run twelve seconds."""
    model = RobotModel(panda())
    path = Circle()
    # with restrictions the arm would never touch the board; without them it anticipates and reacts
    settings = replace(profile("paper"), approach=None)
    board = Box("board", center=(0.62, -0.27, 0.5), half_size=(0.15, 0.02, 0.12), stiffness=25_000.0)
    room = SceneSpec(boxes=(board,))
    arm = Plant(model, room, PlantParams(), brought_to(model, path.point(0.0)), seed=1)
    skin = paper_skin(model)
    units = RangeFinders(arm, skin, RangeFinderParams(), seed=1)
    controller = Controller(model, skin, fixtures(room), path, settings)
    clock = PlantClock(arm, settings.task.control_period_s)
    run(controller, arm, units, clock, Narrator(skin.ids, model.links), lambda step: step.stamp > 12.0)


if __name__ == "__main__":
    main()
