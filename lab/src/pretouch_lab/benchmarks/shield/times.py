"""How long a step takes with each filter, and how long a new process takes to its first answer."""

import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pretouch.atomic_write import write_json
from pretouch.controller import Controller, ControllerState
from pretouch.desired import twist
from pretouch.errors import ExperimentError
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import at_rate
from pretouch.types import ControlStep
from pretouch_lab.benchmarks.avoidance.setting import arm
from pretouch_lab.benchmarks.shield.filters import FILTERS
from pretouch_lab.benchmarks.workload import Workload
from pretouch_lab.rows import Row, rounded

POINTS = 32
"""Points that are sensed."""
_RATE_HZ = 1000.0
_SETTLE = 1500
"""Steps before those that are timed: the force window fills, and the arm gets up to speed."""
_STARTS = 2
"""New processes, of which the quicker one counts: the first may have to compile."""
_SPEED_M_S, _TURN_S = 0.2, 4.0
"""The commander moves the hand to and fro along y: how fast, and how long a turn takes."""


class _Timed:
    """A controller at work among spheres, with a commander."""

    def __init__(self, filter_name: str) -> None:
        profile = at_rate(FILTERS[filter_name], _RATE_HZ)
        self._work = Workload(arm(), POINTS, profile, 0)
        self.controller = Controller(arm(), self._work.skin, no_fixtures(), self._work.path, profile)
        self._state: ControllerState = self.controller.init(self._work.inputs().robot)

    def step(self) -> tuple[int, ControlStep]:
        """Do one step; return its processor time [ns]."""
        given = self._work.inputs()
        speed = _SPEED_M_S * np.cos(2 * np.pi * given.stamp / _TURN_S)
        inputs = replace(given, desired=twist(given.stamp, (0.0, speed, 0.0)))
        before = time.process_time_ns()
        step, self._state = self.controller.step(self._state, inputs)
        took = time.process_time_ns() - before
        self._work.move(step.command)
        return took, step


def time_steps(filter_name: str, steps: int) -> Row:
    """Time steps at 1 kHz with `POINTS` points, and a process of its own up to its first answer."""
    timed = _Timed(filter_name)
    for _ in range(_SETTLE):
        timed.step()
    took = 1e-3 * np.array([timed.step()[0] for _ in range(steps)])
    begun = min(_start_up(filter_name) for _ in range(_STARTS))
    median, p999 = np.percentile(took, [50, 99.9])
    return {"median_us": rounded(median, 1), "p999_us": rounded(p999, 1), "startup_s": rounded(begun)}


def _start_up(filter_name: str) -> float:
    """Time from the start of Python to the first answer [s]."""
    program = f"from {__name__} import answer_once; answer_once({filter_name!r})"
    begin = time.perf_counter()
    try:
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)  # noqa: S603 (ours)
    except subprocess.CalledProcessError as error:
        raise ExperimentError(f"The filter {filter_name} gave no answer in a new process: {error.stderr}") from error
    return time.perf_counter() - begin


def answer_once(filter_name: str) -> None:
    """Do the first step."""
    _Timed(filter_name).step()


def keep_times(filter_name: str, steps: int, file: Path) -> None:
    """Measure, and write the row to a file."""
    write_json({"part": "times", "filter": filter_name, **time_steps(filter_name, steps)}, file)
