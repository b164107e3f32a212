"""How much faster than real time the closed loop runs on one core.

Simulated arm at 1 kHz, seven units with 19 rays each at 50 Hz, controller at 100 Hz with the profile `paper`, on the
paper's circle with nothing near. Counted is the CPU time of the process, so other load hardly disturbs it. A first,
short run compiles everything and is not counted.

    python benchmarks/simulation.py
    python benchmarks/simulation.py 60    # simulated seconds, 30 unless given
"""

import sys
import time

from pretouch.control.path import Circle
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.loop import Cycle, run
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import SceneSpec, fixtures


class Tally:
    """A recorder that only counts."""

    def __init__(self) -> None:
        self.steps = 0

    def record(self, _cycle: Cycle) -> None:
        """Count one step."""
        self.steps += 1


def simulate(duration: float) -> tuple[float, int]:
    """Run the loop for some simulated seconds; return CPU seconds and control steps."""
    model, scene, circle = RobotModel(panda()), SceneSpec(), Circle()
    skin = paper_skin(model)
    plant = Plant(model, scene, PlantParams(), brought_to(model, circle.point(0.0)), seed=0)
    finders = RangeFinders(plant, skin, RangeFinderParams(), seed=0)
    controller = Controller(model, skin, fixtures(scene), circle, profile("paper"))
    plant.advance(0.1)  # every unit has spoken
    tally, start = Tally(), time.process_time()
    run(controller, plant, finders, PlantClock(plant, 0.01), tally, lambda step: step.stamp > duration)
    return time.process_time() - start, tally.steps


def main() -> None:
    """Warm up, measure, print."""
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    simulate(2.0)
    spent, steps = simulate(duration)
    print(f"{duration:g} s of simulated time in {spent:.2f} s of CPU time: {duration / spent:.1f} times real time")
    print(f"{1e3 * spent / steps:.3f} ms for each 10 ms cycle ({steps} cycles)")


if __name__ == "__main__":
    main()
