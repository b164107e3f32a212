"""Streams: what the interface and skin of an arm said, step by step, so that any detector can be given the same again.

The arm goes on whatever touches it, in a room with one ghost.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from pretouch.atomic_write import atomic_replacement
from pretouch.control.path import Path as TaskPath
from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.profiles import profile
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.scene import GhostSpec, SceneSpec
from pretouch.types import FloatArray, IntArray, Mode, Obstacles, RobotState, no_obstacles
from pretouch_lab.bench.scenes import Sensing, model
from pretouch_lab.replay import Ghost, Place
from pretouch_lab.trial import Setup, Simulation

PROFILE = "paper:detect.f_base_n=1000:slow=none:approach=none:perception.closing=on:perception.self_aside_m=0.005"
"""Of the arms that are recorded: proximity is sensed, but no force is a contact and nothing near changes the motion.
Closing speeds are there for the detectors that use them, and the arm is left out as `pretouch` does, for all."""

_ROBOT = tuple(f.name for f in fields(RobotState))
_OBSTACLES = Obstacles._fields
AWAY = np.array([0.0, 0.0, 4.0])
"""Where the ghost is while it is not there [m]: no unit sees so far."""
_RETURN_M_S = 0.1
"""Bound on the speed at which a standing arm goes back to where it is to stand [m/s]."""
NOTHING = no_obstacles()
"""What a profile without proximity is shown."""


@dataclass(frozen=True)
class Stream:
    """S control steps of one arm."""

    robot: dict[str, FloatArray]
    """Each field of `RobotState`, (S, ...); a missing wrench is NaN."""
    reacting: FloatArray
    """(S,) 1 where the arm moved with a contact, 0 elsewhere."""
    watched: FloatArray
    """(S,) 1 where a skin watched, all of its units heard, 0 elsewhere."""
    count: IntArray
    """(S,) how many obstacles there were."""
    obstacles: dict[str, Any]
    """Each field of `Obstacles` of all steps, one after the other, (sum of counts, ...)."""
    truth: dict[str, FloatArray] = field(default_factory=dict)
    """What else is known of the trial, by name."""

    @property
    def stamp(self) -> FloatArray:
        """Instants (S,) of the robot's states [s]."""
        return self.robot["stamp"]

    def steps(self) -> Iterator[tuple[RobotState, Obstacles, bool, bool]]:
        """Give each step as the controller had it: robot, obstacles, whether it was reacting, and a skin watched."""
        ends = np.cumsum(self.count)
        wrench = self.robot["wrench"]
        for i, (end, number) in enumerate(zip(ends.tolist(), self.count.tolist(), strict=True)):
            values: dict[str, Any] = {name: self.robot[name][i] for name in _ROBOT}
            values["stamp"] = float(values["stamp"])
            values["wrench"] = None if np.isnan(wrench[i, 0]) else wrench[i]
            near = {name: self.obstacles[name][end - number : end] for name in _OBSTACLES}
            yield RobotState(**values), Obstacles(**near), bool(self.reacting[i]), bool(self.watched[i])

    def obstacle_points(self, step: int) -> FloatArray:
        """Return the obstacle points (K, 3) [m] of a step."""
        end = int(self.count[: step + 1].sum())
        return np.asarray(self.obstacles["point"][end - int(self.count[step]) : end])


class StreamRecorder:
    """Keeps of each turn of the loop what detection is given; the plant's own log is thrown away as it comes."""

    def __init__(self, plant: Plant, look: Callable[[Cycle], None] = lambda cycle: None) -> None:
        """Take the plant, and what else is to be called with each cycle."""
        self._plant, self._look = plant, look
        self._patience = profile(PROFILE).sight.slow_after_s
        self._robot: list[RobotState] = []
        self._obstacles: list[Obstacles] = []
        self._reacting: list[bool] = []
        self._watched: list[bool] = []

    def record(self, cycle: Cycle) -> None:
        """Keep one turn of the loop."""
        self._plant.take_log()
        self._robot.append(cycle.after.robot)
        self._obstacles.append(cycle.step.obstacles)
        self._reacting.append(cycle.before.mode.mode is Mode.REACT)
        heard = cycle.after.memory.get("tracks.heard")
        self._watched.append(len(heard) > 0 and cycle.step.stamp - float(heard.min()) <= self._patience)
        self._look(cycle)

    def stream(self, truth: dict[str, FloatArray] | None = None) -> Stream:
        """Return all that was kept."""
        robot = {name: np.array([getattr(state, name) for state in self._robot]) for name in _ROBOT if name != "wrench"}
        nothing = np.full(6, np.nan)
        robot["wrench"] = np.array([nothing if s.wrench is None else s.wrench for s in self._robot])
        near = {name: np.concatenate([getattr(o, name) for o in self._obstacles]) for name in _OBSTACLES}
        count = np.array([len(o.unit) for o in self._obstacles], dtype=np.int64)
        reacting, watched = (np.array(flags, dtype=np.float64) for flags in (self._reacting, self._watched))
        return Stream(robot, reacting, watched, count, near, truth or {})


def save_stream(stream: Stream, path: Path) -> None:
    """Write a stream to an .npz file, whole or not at all."""
    arrays: dict[str, FloatArray] = {"reacting": stream.reacting, "watched": stream.watched, "count": stream.count}  # type: ignore[dict-item]
    for part in ("robot", "obstacles", "truth"):
        arrays |= {f"{part}.{name}": values for name, values in getattr(stream, part).items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_replacement(path) as unfinished, unfinished.open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]  # names of arrays, not `allow_pickle`


def load_stream(path: Path) -> Stream | None:
    """Read a stream; None where there is none, or one that cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as kept:
            arrays = dict(kept)
        parts: dict[str, dict[str, FloatArray]] = {"robot": {}, "obstacles": {}, "truth": {}}
        for name, values in arrays.items():
            part, _, what = name.partition(".")
            if what:
                parts[part][what] = values
        return Stream(**parts, reacting=arrays["reacting"], watched=arrays["watched"], count=arrays["count"])
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None


@dataclass(frozen=True)
class Alone:
    """An arm that is left to itself but for what `prepare` has done to it."""

    path: TaskPath
    speed_m_s: float
    """Speed along the path [m/s]; 0 stands."""
    plant: PlantParams
    sensing: Sensing
    ghost_radius: float
    """[m]"""
    seed: int
    end_s: float
    """When it ends [s]."""
    world: str = ""
    """Set of the domain randomisation of which the seed draws one, or none."""
    start: FloatArray | None = None
    """Joint positions (n,) in which it begins [rad]; None: those in which its path does."""
    controller: Callable[..., Controller] = Controller
    """Makes its controller, as `Controller` is made."""


Prepare = Callable[[Plant], Place]
"""Has things done to an arm before each physics step, and returns where the ghost is."""


def record(
    what: Alone, prepare: Prepare, look: Callable[[Plant, Ghost, Cycle], None] = lambda plant, ghost, cycle: None
) -> Stream:
    """Let an arm run until its end and return its stream; `look(plant, ghost, cycle)` sees each cycle."""
    own, sensing = profile(PROFILE), what.sensing
    task = replace(own.task, speed_m_s=what.speed_m_s or _RETURN_M_S)
    start = (float(AWAY[0]), float(AWAY[1]), float(AWAY[2]))
    ghosts: list[Ghost] = []
    setup = Setup(
        model(),
        sensing.skin,
        replace(own, task=task),
        SceneSpec(ghost=GhostSpec(what.ghost_radius, start)),
        what.path,
        what.seed,
        believed=None if sensing.believed is sensing.skin else sensing.believed,
        plant=what.plant,
        ranging=sensing.ranging,
        world=what.world,
        prepare=lambda plant, _: ghosts.append(Ghost(plant, prepare(plant))),
        start=what.start,
        controller=what.controller,
    )
    made = Simulation(setup)
    recorder = StreamRecorder(made.plant, lambda cycle: look(made.plant, ghosts[0], cycle))
    made.run(recorder, lambda step: step.stamp >= what.end_s - 0.5 * task.control_period_s)
    return recorder.stream()
