"""One trial: an arm in a scene under the controller, and everything it left behind."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path as FilePath

import numpy as np

from pretouch import ports
from pretouch.control.path import Path
from pretouch.controller import Controller
from pretouch.desired import Desired
from pretouch.errors import RecordingError
from pretouch.loop import Cycle, Options, Recorder, run
from pretouch.profiles import Profile
from pretouch.recording.run_record import RunRecord, TrueForces, columns_of, contacts_of
from pretouch.recording.simulation import Truth, truth_of
from pretouch.recording.writer import Recording
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import Hand, HandScript, PersonArm
from pretouch.sim.plant import TOUCH_N, Plant, PlantClock, Touch
from pretouch.sim.plant_params import PlantParams
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import SceneSpec, described, fixtures
from pretouch.sim.touch_sensor import SimulatedTouchSkin, TouchErrors, TouchSensors
from pretouch.types import ControlStep, FloatArray, Mode
from pretouch_lab.domain_randomisation import Parts, randomised
from pretouch_lab.run import Row

Trace = tuple[Row, RunRecord]
"""A cell with the course of its trial."""
SETTLE_S = 0.2
"""Time the arm stands before the controller starts [s]: the observer's transient is over."""


@dataclass(frozen=True)
class Setup:
    """What a trial is made of."""

    model: RobotModel
    skin: Skin
    """Where the units truly sit: these measure."""
    profile: Profile
    scene: SceneSpec
    path: Path
    seed: int
    believed: Skin | None = None
    """Where the controller believes the same units to be, in the same order; none, and it knows the truth. A recording
    holds what it believes."""
    hand: HandScript | None = None
    person: PersonArm = field(default_factory=PersonArm)
    """What moves the hand."""
    plant: PlantParams = field(default_factory=PlantParams)
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    recording: FilePath | None = None
    """File to record it in; none, and it is not recorded."""
    world: str = ""
    """Set of the domain randomisation (`sim.randomisation`) of which the seed draws one; none: plant, ranging and skin
    as they are."""
    commander: Callable[[Plant, Hand | None], Callable[[], Desired | None]] | None = None
    """Makes what is asked for a desired motion in each step; none, and the arm follows the path."""
    prepare: Callable[[Plant, RangeFinders], object] | None = None
    """What else is to happen: may have things done before each physics step, to the arm or to its units."""
    start: FloatArray | None = None
    """Joint positions (n,) in which it begins [rad]; None: those in which its path does."""
    controller: Callable[..., Controller] = Controller
    """Makes its controller, as `Controller` is made."""


@dataclass(frozen=True)
class Record:
    """What a trial left behind."""

    steps: list[ControlStep]
    true_time: FloatArray
    """(T,) instants of the physics [s]."""
    true_force: FloatArray
    """(T, 3) sum of the contact forces on the arm [N], base frame."""
    touches: list[Touch]
    """Each beginning of a contact of the arm."""
    hand_position: FloatArray
    """(S, 3) centre of the hand at each control step [m], NaN without a hand."""

    def times(self) -> FloatArray:
        """Instants (S,) of the control steps [s]."""
        return np.array([s.stamp for s in self.steps])

    def forces(self) -> FloatArray:
        """Estimated external forces (S, 3) [N]."""
        return np.array([s.force for s in self.steps])

    def first_contact(self, after: float = 0.0) -> float | None:
        """Instant [s] at which the true force first passes 1 N after a time [s], or None."""
        touching = np.flatnonzero((np.linalg.norm(self.true_force, axis=1) > TOUCH_N) & (self.true_time > after))
        return float(self.true_time[touching[0]]) if len(touching) else None

    def reactions(self) -> list[ControlStep]:
        """Return the steps in which a reaction began."""
        return [s for s in self.steps if s.contact is not None]

    def beginnings(self) -> list[tuple[ControlStep, FloatArray]]:
        """Return the steps in which a reaction began, each with the first velocity (3,) [m/s] that came of it.

        That may be some steps later, where a joint at rest has to be torn loose; 0 if the arm never moved.
        """
        return [(s, _first_velocity(self.steps[i:])) for i, s in enumerate(self.steps) if s.contact is not None]

    def started(self) -> int:
        """Index of the first step in which the arm does not hold, as it does while its window fills."""
        return next((i for i, s in enumerate(self.steps) if s.mode is not Mode.HOLD), len(self.steps))

    def held(self) -> bool:
        """Whether the arm held for another reason than filling its window at the start."""
        return any(s.mode is Mode.HOLD for s in self.steps[self.started() :])


def _first_velocity(steps: list[ControlStep]) -> FloatArray:
    """Return the first velocity (3,) [m/s] of the reaction that begins with these steps."""
    going = takewhile(lambda step: step.mode is Mode.REACT, steps)
    return next((s.reaction_velocity for s in going if s.reaction_velocity.any()), np.zeros(3))


def trace_of(record: Record) -> RunRecord:
    """Return what a trial left behind as arrays."""
    truth, contacts = TrueForces(record.true_time, record.true_force), tuple(contacts_of(record.steps))
    return RunRecord(**columns_of(record.steps), contacts=contacts, truth=truth)


class _TrialRecorder:
    """Keeps each step, and where the hand was; all of it in a recording too, if there is one."""

    def __init__(self, plant: Plant, hand: Hand | None, recording: Recording | None) -> None:
        self._plant, self._hand, self._recording = plant, hand, recording
        self._forces = self._touches = 0
        self.steps: list[ControlStep] = []
        self.hand_position: list[FloatArray] = []

    def record(self, cycle: Cycle) -> None:
        self.steps.append(cycle.step)
        self.hand_position.append(self._hand.position.copy() if self._hand else np.full(3, np.nan))
        if self._recording:
            self._recording.record(cycle, self._truth())

    def _truth(self) -> Truth:
        """What the physics did since the last cycle."""
        plant = self._plant
        forces, touches = plant.true_log[self._forces :], plant.touches[self._touches :]
        self._forces, self._touches = len(plant.true_log), len(plant.touches)
        return truth_of(forces, touches, self.hand_position[-1])


class SimulatedTrial:
    """The arm of a setup in its scene under its controller: it stands, and its observer's transient is over."""

    def __init__(self, setup: Setup) -> None:
        """Build it, as its seed draws it of a world if one is named."""
        own = Parts(setup.plant, setup.ranging, setup.skin, setup.believed)
        parts = randomised(setup.world, setup.seed, setup.model, own)
        model, scene = setup.model, setup.scene
        begin = brought_to(model, setup.path.point(0.0)) if setup.start is None else setup.start
        self.plant = Plant(model, scene, parts.plant, begin, setup.seed)
        units = RangeFinders(self.plant, setup.skin, parts.ranging, setup.seed)
        self.hand = Hand(self.plant, setup.hand, setup.person) if setup.hand else None
        if setup.prepare:
            setup.prepare(self.plant, units)
        believed = setup.skin if parts.believed is None else parts.believed
        self.controller = setup.controller(model, believed, fixtures(scene), setup.path, setup.profile)
        self.clock = PlantClock(self.plant, setup.profile.task.control_period_s)
        self.skin: ports.SkinPort = units
        if len(setup.skin.touching):
            touch = TouchSensors(self.plant, setup.skin, TouchErrors(), setup.seed)
            self.skin = SimulatedTouchSkin(units.read, touch.touch)
        self.plant.advance(SETTLE_S)

    def run(self, recorder: Recorder, done: Callable[[ControlStep], bool], options: Options | None = None) -> None:
        """Turn it until `done` says so of a step."""
        run(self.controller, self.plant, self.skin, self.clock, recorder, done, options or Options())


def play(setup: Setup, done: Callable[[ControlStep, Plant], bool]) -> Record:
    """Run a trial until `done` says so of a step. A recording that could not be kept whole is a RecordingError."""
    made = SimulatedTrial(setup)
    plant, about = made.plant, {"seed": setup.seed, "scene": described(setup.scene)}
    if setup.world:
        about["world"] = setup.world
    with Recording(setup.recording, made.controller, about) if setup.recording else nullcontext() as recording:
        recorder = _TrialRecorder(plant, made.hand, recording)
        options = Options(desired=setup.commander(plant, made.hand)) if setup.commander else None
        made.run(recorder, lambda step: done(step, plant), options)
    if recording and recording.trouble:
        raise RecordingError(recording.trouble)
    return Record(
        recorder.steps,
        np.array([t for t, _ in plant.true_log]),
        np.array([f for _, f in plant.true_log]),
        plant.touches,
        np.array(recorder.hand_position),
    )
