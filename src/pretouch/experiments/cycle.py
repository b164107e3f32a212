"""What one control step costs: processor and wall time at a rate, and the share of each stage."""

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from pretouch.controller import STAGES, Controller, ControllerState
from pretouch.errors import ExperimentError
from pretouch.experiments.workload import Workload
from pretouch.loop import MonotonicClock
from pretouch.params import Profile, at_rate, profile
from pretouch.perception.scene_filter import no_fixtures
from pretouch.realtime import real_time, warm_up
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, IntArray, Mode

Row = dict[str, Any]

_SETTLE = 500
"""Cycles after the force window is full in which the arm gets up to speed."""
_STAGED = 2000
"""Most cycles in which the stages are told apart."""
_PACKAGES = ("pretouch", "numpy", "numba", "mujoco-core", "daqp")


@dataclass(frozen=True)
class CycleRequest:
    """How to measure."""

    rate: float = 1000.0
    """[Hz]"""
    cycles: int = 20_000
    """Measured steps."""
    profile: str = "paper"
    """Profile, in which everything counted in cycles is brought to the rate."""
    priority: int | None = None
    cpu: int | None = None
    """See `pretouch.realtime.real_time`."""
    seed: int = 0
    """Of the scene, the skin and the force noise."""

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise ExperimentError(f"The number of cycles is {self.cycles}: give 1 or more.")
        if self.seed < 0:
            raise ExperimentError(f"The seed is {self.seed}: give 0 or more.")
        self.at_rate()

    def at_rate(self) -> Profile:
        """Return the profile for the rate."""
        return at_rate(profile(self.profile), self.rate)


def measure(points: int, request: CycleRequest, tell: Callable[[str], None] = lambda sentence: None) -> Row:
    """Time the control step with a skin of that many points: a row of `pretouch bench cycle`.

    First a paced run that is timed from outside, then a shorter one, back to back, in which the controller says where
    one stage ends and the next begins. `tell` is given what real time could not be had.
    """
    model, params = RobotModel(panda()), request.at_rate()
    work = Workload(model, points, params, request.seed)
    controller = Controller(model, work.skin, no_fixtures(), work.path, params)
    warm_up(controller, work.inputs().robot)
    with real_time(request.priority, request.cpu) as missing:
        for sentence in missing:
            tell(sentence)
        paced = _paced(controller, work, request)
        shares = _stages(model, points, params, request)
    cpu, wall = paced.cpu / 1000, paced.wall / 1000
    return {
        "points": points,
        **_spread(cpu),
        "overruns": int((paced.wall > 1e9 / request.rate).sum()),
        "stages": shares,
        **{f"wall_{name}": value for name, value in _spread(wall).items()},
        "cycles": request.cycles,
        "missed_ticks": paced.missed,
        "wake_up_median_us": paced.wake_up_us,
        "restricting_median": float(np.median(paced.restricting)),
        "tracking": float(paced.tracking.mean()),
        "travelled_m": paced.travelled,
    }


@dataclass(frozen=True)
class _Paced:
    """What a run at the rate came to."""

    cpu: IntArray
    """(cycles,) processor time of each step [ns], all threads."""
    wall: IntArray
    """(cycles,) [ns]"""
    restricting: IntArray
    """(cycles,) points that restrict."""
    tracking: IntArray
    """(cycles,) 1 where the arm follows its path."""
    travelled: float
    """Arc length along the path [m]."""
    missed: int
    wake_up_us: float | None
    """Median of how late the machine woke the loop [us], None if the loop was never early enough to wait."""


def _settled(controller: Controller, work: Workload) -> ControllerState:
    """Turn the controller until the arm moves; return its state."""
    state = controller.init(work.inputs().robot)
    for _ in range(controller.profile.threshold.window_samples + _SETTLE):
        step, state = controller.step(state, work.inputs())
        work.move(step.command)
    return state


def _paced(controller: Controller, work: Workload, request: CycleRequest) -> _Paced:
    cpu, wall, restricting, tracking = (np.zeros(request.cycles, np.int64) for _ in range(4))
    state = _settled(controller, work)
    begin = state.path.phase
    clock = MonotonicClock(1 / request.rate)
    for i in range(request.cycles):
        clock.tick()
        inputs = work.inputs()
        cpu_before, before = time.process_time_ns(), time.perf_counter_ns()
        step, state = controller.step(state, inputs)
        after, cpu_after = time.perf_counter_ns(), time.process_time_ns()
        cpu[i], wall[i] = cpu_after - cpu_before, after - before
        restricting[i], tracking[i] = len(step.restricted), step.mode is Mode.TRACK
        work.move(step.command)
    late = clock.timing().wake_up
    wake_up_us = 1e6 * late.median if late.max > 0 else None
    return _Paced(cpu, wall, restricting, tracking, state.path.phase - begin, clock.missed, wake_up_us)


def _stages(model: RobotModel, points: int, params: Profile, request: CycleRequest) -> dict[str, float]:
    """Share of each stage in a step: medians over the cycles, of their sum."""
    cycles = min(request.cycles, _STAGED)
    watch = _Stopwatch(cycles)
    work = Workload(model, points, params, request.seed)
    controller = Controller(model, work.skin, no_fixtures(), work.path, params, mark=watch.mark)
    state = _settled(controller, work)
    for i in range(cycles):
        inputs = work.inputs()
        watch.begin(i)
        step, state = controller.step(state, inputs)
        work.move(step.command)
    medians = np.median(watch.took, axis=0)
    return {name: float(share) for name, share in zip(STAGES, medians / medians.sum(), strict=True)}


class _Stopwatch:
    """How long each stage of each cycle took."""

    def __init__(self, cycles: int) -> None:
        self.took = np.zeros((cycles, len(STAGES)), np.int64)
        """[ns]"""
        self._place = {name: i for i, name in enumerate(STAGES)}
        self._row = self._before = 0

    def begin(self, cycle: int) -> None:
        self._row = cycle
        self.took[cycle] = 0
        self._before = time.perf_counter_ns()

    def mark(self, stage: str) -> None:
        now = time.perf_counter_ns()
        self.took[self._row, self._place[stage]] += now - self._before
        self._before = time.perf_counter_ns()


def _spread(us: FloatArray) -> dict[str, float]:
    median, p99, p999 = map(float, np.percentile(us, [50, 99, 99.9]))
    return {"median_us": median, "p99_us": p99, "p999_us": p999, "max_us": float(us.max())}


def about(request: CycleRequest) -> Row:
    """Say where and how was measured, for the file of the results."""
    return {
        "rate_hz": request.rate,
        "profile": request.profile,
        "seed": request.seed,
        "priority": request.priority,
        "cpu": request.cpu,
        "readings": "all new in every cycle",
        "python": platform.python_version(),
        "versions": {name: version(name) for name in _PACKAGES},
        "processor": _processor(),
        "processors": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()
