"""Processor and wall time of a control step at a rate."""

import os
import platform
import resource
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pretouch.controller import Controller
from pretouch.errors import ExperimentError
from pretouch.loop import MonotonicClock
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import Profile, at_rate, profile
from pretouch.realtime import real_time, warm_up
from pretouch.recording.run import processor
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.text_table import TextTable
from pretouch.types import IntArray, Mode
from pretouch_lab.bench.workload import UNIT_RATE, Workload
from pretouch_lab.run import Row
from pretouch_lab.table import Column, table

_SETTLE = 500
"""Cycles after the force window is full, in which the arm accelerates."""
_SHORTER = 5000
"""Largest number of cycles in which every reading is new."""
_MOST_CYCLES = 10_000_000
_SLOWEST, _FASTEST = 20.0, 10_000.0
"""Lowest and highest rate [Hz]: below, every step counts as late; above, the control period is too short."""
_PACKAGES = ("pretouch", "numpy", "numba", "mujoco-core")


@dataclass(frozen=True)
class CycleRequest:
    """Parameters of a measurement."""

    rate_hz: float = 1000.0
    cycles: int = 20_000
    """Number of measured steps."""
    profile: str = "paper"
    """Profile; its numbers of cycles are scaled to the rate."""
    priority: int | None = None
    cpu: int | None = None
    """See `pretouch.realtime.real_time`."""
    arm: str = "panda"
    """Name of the arm, or the folder of an imported one."""

    def __post_init__(self) -> None:
        if not 1 <= self.cycles <= _MOST_CYCLES:
            raise ExperimentError(f"The number of cycles is {self.cycles}: give 1 to {_MOST_CYCLES}.")
        if not _SLOWEST < self.rate_hz <= _FASTEST:
            raise ExperimentError(
                f"The rate is {self.rate_hz:g} Hz: give more than {_SLOWEST:g} and up to {_FASTEST:g} Hz."
            )
        self.at_rate()

    def at_rate(self) -> Profile:
        """Return the profile for the rate."""
        return at_rate(profile(self.profile), self.rate_hz)


def measure(points: int, request: CycleRequest, tell: Callable[[str], None] = lambda sentence: None) -> Row:
    """Time the control step with a skin of `points` units: a row of `pretouch bench cycle`.

    Three runs are timed: steps back to back, the same with every reading new in every cycle, and steps at the ticks of
    a clock, between which the processor sleeps and its caches cool. `tell` receives a sentence for each real-time
    setting that the system refused.
    """
    model, params = RobotModel(robot_named(request.arm)), request.at_rate()
    work, hard, paced = (Workload(model, points, params, 0, new) for new in (False, True, False))
    controller, clock = (
        Controller(model, work.skin, no_fixtures(), work.path, params),
        MonotonicClock(1 / request.rate_hz),
    )
    warm_up(controller, work.inputs().robot)
    with real_time(request.priority, request.cpu) as missing:
        for sentence in missing:
            tell(sentence)
        steps = _timed(controller, work, request.cycles)
        all_new = _timed(controller, hard, min(request.cycles, _SHORTER))
        at_rate = _timed(controller, paced, request.cycles, clock)
    runs = {"": steps.cpu, "all_new_": all_new.cpu, "at_rate_": at_rate.cpu, "wall_": at_rate.wall}
    return {
        "points": points,
        **{f"{run}{name}": value for run, took in runs.items() for name, value in _spread(took).items()},
        "overruns": int((at_rate.wall > 1e9 / request.rate_hz).sum()),
        "cycles": request.cycles,
        "missed_ticks": clock.missed,
        "memory_gained_kib": at_rate.gained // 1024,
        "restricting_median": float(np.median(steps.restricting)),
        "tracking": float(steps.tracking.mean()),
    }


class _Timed(NamedTuple):
    """Times of one run."""

    cpu: IntArray
    """(cycles,) processor time of each step [ns], all threads."""
    wall: IntArray
    """(cycles,) wall time of each step [ns]."""
    restricting: IntArray
    """(cycles,) number of points that restrict the motion."""
    tracking: IntArray
    """(cycles,) 1 while the arm follows its path, else 0."""
    gained: int
    """Growth of the process's memory during the run [B]."""


def _timed(controller: Controller, work: Workload, cycles: int, clock: MonotonicClock | None = None) -> _Timed:
    """Time each step once the arm moves, at the ticks of a clock or back to back."""
    # filled, so that pages first written in the run do not count as growth
    cpu, wall, restricting, tracking = np.full((4, cycles), 0)
    state = controller.init(work.inputs().robot)
    for i in range(-controller.profile.window.samples - _SETTLE, cycles):
        if i == 0:
            memory = _resident()
        if clock and i >= 0:
            clock.tick()
        inputs = work.inputs()
        cpu_before, before = time.process_time_ns(), time.perf_counter_ns()
        step, state = controller.step(state, inputs)
        after, cpu_after = time.perf_counter_ns(), time.process_time_ns()
        if i >= 0:
            cpu[i], wall[i] = cpu_after - cpu_before, after - before
            restricting[i], tracking[i] = len(step.restricted), step.mode is Mode.TRACK
        work.move(step.command)
    return _Timed(cpu, wall, restricting, tracking, _resident() - memory)


def _resident() -> int:
    """Memory of this process [B]."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * resource.getpagesize()


def _spread(took: IntArray) -> dict[str, float]:
    names = ("median_us", "p99_us", "p999_us", "max_us")
    return dict(zip(names, (np.percentile(took, [50, 99, 99.9, 100]) / 1000).tolist(), strict=True))


def about(request: CycleRequest) -> Row:
    """Return machine, versions and parameters of the measurement, for the file of the results."""
    return {
        **asdict(request),
        "readings_hz": UNIT_RATE,
        "python": platform.python_version(),
        "versions": {name: version(name) for name in _PACKAGES},
        "processor": processor(),
        "processors": os.cpu_count(),
        "system": platform.platform(),
    }


_COLUMNS = (
    Column("points", "points"),
    Column("", "run"),
    Column("median", "median_us", 0),
    Column("99 %", "p99_us", 0),
    Column("99.9 %", "p999_us", 0),
    Column("largest", "max_us", 0),
    Column("overruns", "overruns"),
    Column("restricting", "restricting"),
)


def tables(rows: list[Row], request: CycleRequest) -> list[TextTable]:
    """Return a table of step times, four lines for each number of points."""
    runs = {"CPU": "", "CPU, all new": "all_new_"}
    runs |= {f"CPU at {request.rate_hz:g} Hz": "at_rate_", f"wall at {request.rate_hz:g} Hz": "wall_"}
    lines: list[Row] = [
        {
            "points": "" if prefix else row["points"],
            "run": name,
            **{c.key: row[prefix + c.key] for c in _COLUMNS if c.key.endswith("_us")},
            "overruns": row["overruns"] if prefix == "wall_" else "",
            "restricting": "" if prefix else f"{row['restricting_median']:.0f}",
        }
        for row in rows
        for name, prefix in runs.items()
    ]
    gained = ", ".join(f"{row['memory_gained_kib']} KiB with {row['points']}" for row in rows)
    idle = [str(row["points"]) for row in rows if row["tracking"] < 1]
    note = (
        "CPU: steps back to back, with 50 readings of each unit a second. All new: every reading is new in every step."
        " At a rate: the processor sleeps between steps, and its caches cool. Overruns: steps longer than the period."
        " Restricting: median number of points within reach of eq. 7. Growth of memory in the run at"
        f" {request.rate_hz:g} Hz: {gained}."
    )
    if idle:
        note += f" With {', '.join(idle)} points the arm did not follow its path in every cycle."
    return [table(f"Time of a control step, {request.cycles} cycles [us]", _COLUMNS, lines, note, 2)]
