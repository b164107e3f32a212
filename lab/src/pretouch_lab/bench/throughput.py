"""Speed of closed-loop trials on one core, as a multiple of real time.

The arm is simulated at 1 kHz, with units of 19 rays each at 50 Hz and a controller at 100 Hz with the profile `paper`,
on the paper's circle: with nothing near, and with a person who pushes three times, in the nominal world or in `hard`.
The measure is the CPU time of the process, which other load hardly changes. A short first run compiles everything.

    python -m pretouch_lab.bench.throughput [SECONDS]    # simulated, 30 by default
"""

import sys
import time

from rich.console import Console

from pretouch.cli.tables import show
from pretouch.control.path import Circle
from pretouch.profiles import profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch.sim.hand import Pusher
from pretouch.sim.paper_scenes import dynamic_pushes
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch_lab.bench.workload import Workload
from pretouch_lab.run import Row
from pretouch_lab.table import Column, table
from pretouch_lab.trial import Setup, play

CASES = ((7, False, ""), (32, False, ""), (7, True, ""), (32, True, ""), (7, True, "hard"), (32, True, "hard"))
"""Number of units, True with a person who pushes, world."""
_COLUMNS = (
    Column("units", "units"),
    Column("person", "person"),
    Column("world", "world"),
    Column("times real time", "speed", 1),
    Column("ms a 10 ms cycle", "cycle_ms", 3),
)


def trial(units: int, person: bool, world: str, duration_s: float) -> Row:
    """Run a trial for some simulated seconds; return a row of the table."""
    model, paper = RobotModel(panda()), profile("paper")
    skin = paper_skin(model) if units == 7 else Workload(model, units, paper, seed=3).skin
    hand, pusher = (HandSpec(), Pusher(model, dynamic_pushes(0))) if person else (None, None)
    setup = Setup(model, skin, paper, SceneSpec(hand=hand), Circle(), seed=0, world=world, hand=pusher)
    start = time.process_time()
    steps = play(setup, lambda step, _: step.stamp > duration_s).steps
    spent = time.process_time() - start
    row = {"units": units, "person": "yes" if person else "no", "world": world or "nominal"}
    return row | {"steps": len(steps), "speed": duration_s / spent, "cycle_ms": 1e3 * spent / len(steps)}


def main(duration_s: float = 30.0) -> None:
    """Warm up, measure, and print the table."""
    for case in CASES:
        trial(*case, 0.5)
    rows = [trial(*case, duration_s) for case in CASES]
    show(Console(), [table(f"Trials of {duration_s:g} s on one core", _COLUMNS, rows, names=3)])


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
