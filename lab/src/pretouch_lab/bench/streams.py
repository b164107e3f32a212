"""Streams: inputs of a detector from an arm and its skin, step by step, so that any detector can replay them.

The arm moves on whatever touches it, in a room with one ghost.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from pretouch.control.path import Path as TaskPath
from pretouch.line import SEE
from pretouch.loop import Cycle, instant
from pretouch.modes import CLEAR
from pretouch.params import PerceptionParams, TaskParams
from pretouch.profiles import profile
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import GhostSpec, SceneSpec
from pretouch.types import ControlStep, FloatArray, IntArray, Mode, Obstacles, RobotState, no_obstacles, some_of
from pretouch_lab.bench.scenes import Sensing, model
from pretouch_lab.replay import Ghost, Place
from pretouch_lab.trial import Setup, SimulatedTrial

PROFILE = "paper:detect.f_base_n=1000:slow=none:approach=none:perception.memory=on:perception.self_aside_m=0.005"
"""Profile of the recorded arms: they sense proximity, but no force is a contact and no obstacle changes the motion.
Places are remembered for detectors that use them. Readings of the arm itself are left out as in `pretouch`."""

_ROBOT = tuple(f.name for f in fields(RobotState))
AWAY = np.array([0.0, 0.0, 4.0])
"""Parking place of the ghost (3,) [m], beyond the range of all units."""
_RETURN_M_S = 0.1
"""Largest speed at which a standing arm returns to its place [m/s]."""
NOTHING = no_obstacles()
"""Obstacles for a profile without proximity."""


@dataclass(frozen=True)
class Stream:
    """S control steps of one arm."""

    robot: dict[str, FloatArray]
    """Each field of `RobotState`, (S, ...); a missing wrench is NaN."""
    reacting: FloatArray
    """(S,) 1 during a reaction to a contact, else 0."""
    watched: FloatArray
    """(S,) 1 while the reports of all units are recent, else 0."""
    count: IntArray
    """(S,) number of obstacles."""
    obstacles: Obstacles
    """Those of all steps, one after the other."""

    @property
    def stamp(self) -> FloatArray:
        """Instants (S,) of the robot's states [s]."""
        return self.robot["stamp"]

    def steps(self) -> Iterator[tuple[RobotState, Obstacles, bool, bool]]:
        """Yield the inputs of each step: robot, obstacles, and flags for a reaction and for a watching skin."""
        ends = np.cumsum(self.count)
        wrench = self.robot["wrench"]
        for i, (end, number) in enumerate(zip(ends.tolist(), self.count.tolist(), strict=True)):
            values: dict[str, Any] = {name: self.robot[name][i] for name in _ROBOT}
            values["stamp"] = float(values["stamp"])
            values["wrench"] = None if np.isnan(wrench[i, 0]) else wrench[i]
            near = some_of(self.obstacles, end - number, end)
            yield RobotState(**values), near, bool(self.reacting[i]), bool(self.watched[i])

    def near(self, see: PerceptionParams | None) -> tuple[Obstacles, IntArray]:
        """Return the obstacles of all steps as a perception shows them, without a memory what is seen now; counts."""
        oldest = -1.0 if see is None else np.inf if see.memory else see.persistence_s
        recent = self.obstacles.age <= oldest
        count = np.bincount(np.repeat(np.arange(len(self.count)), self.count)[recent], minlength=len(self.count))
        return Obstacles._make(part[recent] for part in self.obstacles), count

    def obstacle_points(self, step: int) -> FloatArray:
        """Return the obstacle points (K, 3) [m] of a step."""
        end = int(self.count[: step + 1].sum())
        return self.obstacles.point[end - int(self.count[step]) : end]


class StreamRecorder:
    """Stores the inputs of detection in each cycle, and discards the plant's log."""

    def __init__(self, plant: Plant, look: Callable[[Cycle], None] | None = None) -> None:
        """Take the plant, and a function to call with each cycle."""
        self._plant, self._look = plant, look
        self._patience = profile(PROFILE).sight.slow_after_s
        self._robot: list[FloatArray] = []
        self._obstacles: list[Obstacles] = []
        self._flags: list[tuple[bool, bool]] = []

    def record(self, cycle: Cycle) -> None:
        """Store one cycle."""
        memory = cycle.after.memory
        # the fields of the believed state are contiguous: one copy, as each look-up costs as much
        begin, end = (memory.places[f"watch.robot.{name}"].at for name in ("stamp", "wrench"))
        robot = memory.blocks[0][begin.start : end.stop].copy()
        reacting = cycle.before.mode.mode is Mode.REACT
        self.add(robot, cycle.step.obstacles, cycle.step.stamp, memory.get("tracks.report_stamp"), reacting)
        if self._look:
            self._look(cycle)

    def add(self, robot: FloatArray, near: Obstacles, stamp: float, reports: FloatArray, reacts: bool = False) -> None:
        """Store the robot's state, its fields in one array, the obstacles, and the stamp of each unit's last report."""
        self._plant.take_log()
        self._robot.append(robot)
        self._obstacles.append(near if len(near.unit) else NOTHING)
        self._flags.append((reacts, stamp - float(reports.min(initial=np.inf)) <= self._patience))

    def stream(self) -> Stream:
        """Return the stored steps."""
        near = Obstacles._make(np.concatenate(parts) for parts in zip(*self._obstacles, strict=True))
        count = np.array([len(o.unit) for o in self._obstacles], dtype=np.int64)
        reacting, watched = np.array(self._flags, dtype=np.float64).T
        stamp, *fields = np.split(np.array(self._robot), np.cumsum([1, *[model().n] * 5]), axis=1)
        robot = dict(zip(_ROBOT, (stamp[:, 0].copy(), *(part.copy() for part in fields)), strict=True))
        return Stream(robot, reacting.copy(), watched.copy(), count, near)


Prepare = Callable[[Plant], Place]
"""Registers calls before each physics step of an arm, and returns the place of the ghost."""


@dataclass(frozen=True)
class Alone:
    """Parameters of an arm without a commander; only `prepare` acts on it."""

    path: TaskPath
    speed_m_s: float
    """Speed along the path [m/s]; 0: the arm stands."""
    plant: PlantParams
    sensing: Sensing | None
    """Skin and its errors; None: no units, as nobody is near."""
    ghost_radius: float
    """[m]"""
    seed: int
    end_s: float
    """End of the stream [s]."""
    world: str = ""
    """Set of the domain randomisation that the seed draws from; empty: none."""
    start: FloatArray | None = None
    """Joint positions (n,) at the start [rad]; None: those at the start of the path."""

    def simulation(self, prepare: Callable[[Plant, RangeFinders], object]) -> SimulatedTrial:
        """Build the simulated arm."""
        own, sensing, start = profile(PROFILE), self.sensing, (float(AWAY[0]), float(AWAY[1]), float(AWAY[2]))
        return SimulatedTrial(
            Setup(
                model(),
                sensing.skin if sensing else Skin((), model()),
                replace(own, task=replace(own.task, speed_m_s=self.speed_m_s or _RETURN_M_S)),
                SceneSpec(ghost=GhostSpec(self.ghost_radius, start)),
                self.path,
                self.seed,
                believed=None if sensing is None or sensing.believed is sensing.skin else sensing.believed,
                plant=self.plant,
                ranging=sensing.ranging if sensing else RangeFinderParams(),
                world=self.world,
                prepare=prepare,
                start=self.start,
            )
        )

    def is_over(self, stamp: float) -> bool:
        """Return True for the step at or after the end."""
        return stamp >= self.end_s - 0.5 * TaskParams().control_period_s


def record(what: Alone, prepare: Prepare) -> Stream:
    """Simulate an arm until its end and return its stream."""
    simulation = what.simulation(lambda plant, _: Ghost(plant, prepare(plant)))
    recorder = StreamRecorder(simulation.plant)
    simulation.run(recorder, lambda step: what.is_over(step.stamp))
    return recorder.stream()


def record_moved(what: Alone, prepare: Prepare, command: Callable[[float, FloatArray], FloatArray]) -> Stream:
    """Simulate an arm without a controller until its end, in half the time or less, and return its stream.

    `command(time, q_commanded)` returns the joint velocities (n,) [rad/s] at a time [s] from positions (n,) [rad].
    Only the perception of the controller runs.
    """
    simulation = what.simulation(lambda plant, _: Ghost(plant, prepare(plant)))
    plant, controller, recorder = simulation.plant, simulation.controller, StreamRecorder(simulation.plant)
    memory, stamp = controller.init(plant.read()).memory, -np.inf
    while not what.is_over(stamp):
        tick, state, readings = simulation.clock.tick(), plant.read(), simulation.skin.read()
        stamp = instant(tick, controller.limits.period, state, readings, None)
        plant.command(command(stamp, state.q_commanded))
        wrench = np.full(6, np.nan) if state.wrench is None else state.wrench
        parts = (state.q, state.qd, state.q_commanded, state.qd_commanded, state.tau_ext, wrench)
        near, reports = NOTHING, np.zeros(0)
        if what.sensing:
            now = controller.blank.copy()
            for name in ("stamp", "distance", "status"):
                now.put(f"readings.{name}", getattr(readings, name))
            for name in ("stamp", "q", "qd"):
                now.put(f"robot.{name}", getattr(state, name))
            now.put("stamp", stamp)
            controller.take(memory, now, controller.beside, SEE, SEE)
            near, reports = ControlStep.of(now, CLEAR).obstacles, memory.get("tracks.report_stamp")
        recorder.add(np.concatenate(((state.stamp,), *parts)), near, stamp, reports)
    return recorder.stream()
