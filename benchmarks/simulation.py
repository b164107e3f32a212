"""How much faster than real time closed-loop trials run on one core.

Simulated arm at 1 kHz, units with 19 rays each at 50 Hz, controller at 100 Hz with the profile `paper`, on the paper's
circle: with nothing near, and with a person who pushes three times, in the usual world or in `hard`. Counted is the CPU
time of the process, so other load hardly disturbs it. A first, short run compiles everything and is not counted.

    python benchmarks/simulation.py
    python benchmarks/simulation.py 60    # simulated seconds, 30 unless given
"""

import sys
import time

from pretouch.control.path import Circle
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.hand import Pusher
from pretouch.sim.paper_scenes import dynamic_pushes
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch_lab.bench.workload import Workload
from pretouch_lab.trial import Setup, play

CASES = ((7, False, ""), (32, False, ""), (7, True, ""), (32, True, ""), (7, True, "hard"), (32, True, "hard"))
"""Units, whether a person pushes, world."""


def simulate(units: int, person: bool, world: str, duration: float) -> tuple[float, int]:
    """Run a trial for some simulated seconds; return CPU seconds and control steps."""
    model, paper = RobotModel(panda()), profile("paper")
    skin = paper_skin(model) if units == 7 else Workload(model, units, paper, seed=3).skin
    setup = Setup(
        model, skin, paper, SceneSpec(hand=HandSpec() if person else None), Circle(), seed=0, world=world,
        hand=Pusher(model, dynamic_pushes(0)) if person else None,
    )  # fmt: skip
    start = time.process_time()
    steps = play(setup, lambda step, _: step.stamp > duration).steps
    return time.process_time() - start, len(steps)


def main() -> None:
    """Warm up, measure, print."""
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 30.0
    print(f"{'units':>5}  {'person':6}  {'world':7}  {'times real time':>15}  {'ms a 10 ms cycle':>16}")
    for units, person, world in CASES:
        simulate(units, person, world, 0.5)
        spent, steps = simulate(units, person, world, duration)
        row = f"{units:5}  {'yes' if person else 'no':6}  {world or 'nominal':7}"
        print(f"{row}  {duration / spent:15.1f}  {1e3 * spent / steps:16.3f}", flush=True)


if __name__ == "__main__":
    main()
