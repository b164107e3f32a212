"""One trial: an arm in a scene under the controller, and its record."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
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
from pretouch.recording.simulation import truth_of
from pretouch.recording.writer import Recording
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.sensing.skin import Skin
from pretouch.sim.hand import Hand, HandScript, PersonArm
from pretouch.sim.plant import TOUCH_N, Plant, PlantClock, Touch
from pretouch.sim.plant_params import PlantParams, plant_params_of
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import SceneSpec, described, fixtures
from pretouch.sim.touch_sensor import SimulatedTouchSkin, TouchErrors, TouchSensors
from pretouch.types import ControlStep, FloatArray, Mode
from pretouch_lab.domain_randomisation import Misplacement, drawn, misplaced, named_set, with_own
from pretouch_lab.run import Row

Trace = tuple[Row, RunRecord]
"""A cell with the time course of its trial."""
SETTLE_S = 0.2
"""Standstill before the controller starts [s]: the observer's transient ends within it."""


@dataclass(frozen=True)
class Setup:
    """Arm, skin, profile, scene and path of a trial."""

    model: RobotModel
    skin: Skin
    """Units at their true places: these measure."""
    profile: Profile
    scene: SceneSpec
    path: Path
    seed: int
    believed: Skin | None = None
    """The same units in the same order at the places that the controller assumes; None: the true ones. A recording has
    the assumed places."""
    hand: HandScript | None = None
    person: PersonArm = field(default_factory=PersonArm)
    """Arm of the person that moves the hand."""
    plant: PlantParams = field(default_factory=PlantParams)
    ranging: RangeFinderParams = field(default_factory=RangeFinderParams)
    recording: FilePath | None = None
    """File for the recording; None: no recording."""
    world: str = ""
    """Set of the domain randomisation (`domain_randomisation`) that the seed draws from; empty: plant, ranging and skin
    stay as given."""
    commander: Callable[[Plant, Hand | None], Callable[[], Desired | None]] | None = None
    """Returns a function that gives the desired motion of each step; None: the arm follows the path."""
    prepare: Callable[[Plant, RangeFinders], object] | None = None
    """Called once with plant and units, to register calls before each physics step."""
    start: FloatArray | None = None
    """Joint positions (n,) at the start [rad]; None: those at the start of the path."""


@dataclass(frozen=True)
class Record:
    """Steps, true forces and contacts of a trial."""

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
        """Instant [s] at which the true force first exceeds 1 N after a time [s], or None."""
        touching = np.flatnonzero((np.linalg.norm(self.true_force, axis=1) > TOUCH_N) & (self.true_time > after))
        return float(self.true_time[touching[0]]) if len(touching) else None

    def reactions(self) -> list[ControlStep]:
        """Return the steps in which a reaction began."""
        return [s for s in self.steps if s.contact is not None]

    def beginnings(self) -> list[tuple[ControlStep, FloatArray]]:
        """Return the steps in which a reaction began, each with the first velocity (3,) [m/s] of that reaction.

        The motion may begin some steps later, after static friction; the velocity is 0 if the arm never moved.
        """
        return [(s, _first_velocity(self.steps[i:])) for i, s in enumerate(self.steps) if s.contact is not None]

    def started(self) -> int:
        """Index of the first step after the hold at the start, in which the force window fills."""
        return next((i for i, s in enumerate(self.steps) if s.mode is not Mode.HOLD), len(self.steps))

    def held(self) -> bool:
        """True if the arm held after the start, when the force window was full."""
        return any(s.mode is Mode.HOLD for s in self.steps[self.started() :])


def _first_velocity(steps: list[ControlStep]) -> FloatArray:
    """Return the first velocity (3,) [m/s] of the reaction that begins with these steps."""
    going = takewhile(lambda step: step.mode is Mode.REACT, steps)
    return next((s.reaction_velocity for s in going if s.reaction_velocity.any()), np.zeros(3))


def trace_of(record: Record) -> RunRecord:
    """Return the record of a trial as arrays."""
    truth, contacts = TrueForces(record.true_time, record.true_force), tuple(contacts_of(record.steps))
    return RunRecord(**columns_of(record.steps), contacts=contacts, truth=truth)


class _TrialRecorder:
    """Collects each step and the hand's position, and writes both to a recording if there is one."""

    def __init__(self, plant: Plant, hand: Hand | None, recording: Recording | None) -> None:
        self._plant, self._hand, self._recording = plant, hand, recording
        self._forces = self._touches = 0
        self.steps: list[ControlStep] = []
        self.hand_position: list[FloatArray] = []

    def record(self, cycle: Cycle) -> None:
        self.steps.append(cycle.step)
        self.hand_position.append(self._hand.position.copy() if self._hand else np.full(3, np.nan))
        if self._recording:
            plant = self._plant
            forces, touches = plant.true_log[self._forces :], plant.touches[self._touches :]
            self._forces, self._touches = len(plant.true_log), len(plant.touches)
            self._recording.record(cycle, truth_of(forces, touches, self.hand_position[-1]))


def randomised(setup: Setup) -> Setup:
    """Draw arm, sensors and believed places of a setup from its world by its seed; without a world, nothing.

    A value that differs from the default arm, sensors or skin was set by the experiment, and stays.
    """
    if not setup.world:
        return setup
    usual, believed = plant_params_of(setup.model.description), setup.believed
    world = drawn(named_set(setup.world), setup.seed, usual)
    if believed is None and world.misplaced != Misplacement() and len(setup.skin):
        believed = misplaced(setup.skin, setup.model, world.misplaced, setup.seed)
    ranging = with_own(world.ranging, setup.ranging, RangeFinderParams())
    return replace(setup, plant=with_own(world.plant, setup.plant, usual), ranging=ranging, believed=believed)


class SimulatedTrial:
    """The arm of a setup in its scene under its controller, at rest after the observer's transient."""

    def __init__(self, setup: Setup) -> None:
        """Build arm, skin and controller; the seed draws them from the world of the setup, if any."""
        setup = randomised(setup)
        model, scene = setup.model, setup.scene
        begin = brought_to(model, setup.path.point(0.0)) if setup.start is None else setup.start
        self.plant = Plant(model, scene, setup.plant, begin, setup.seed)
        units = RangeFinders(self.plant, setup.skin, setup.ranging, setup.seed)
        self.hand = Hand(self.plant, setup.hand, setup.person) if setup.hand else None
        if setup.prepare:
            setup.prepare(self.plant, units)
        believed = setup.skin if setup.believed is None else setup.believed
        self.controller = Controller(model, believed, fixtures(scene), setup.path, setup.profile)
        self.clock = PlantClock(self.plant, setup.profile.task.control_period_s)
        self.skin: ports.SkinPort = units
        if len(setup.skin.touching):
            touch = TouchSensors(self.plant, setup.skin, TouchErrors(), setup.seed)
            self.skin = SimulatedTouchSkin(units.read, touch.touch)
        self.plant.advance(SETTLE_S)

    def run(self, recorder: Recorder, done: Callable[[ControlStep], bool], options: Options | None = None) -> None:
        """Run control cycles until `done(step)` is true."""
        run(self.controller, self.plant, self.skin, self.clock, recorder, done, options or Options())


def play(setup: Setup, done: Callable[[ControlStep, Plant], bool]) -> Record:
    """Run a trial until `done(step, plant)` is true. Raises RecordingError for an incomplete recording."""
    trial = SimulatedTrial(setup)
    plant, about = trial.plant, {"seed": setup.seed, "scene": described(setup.scene)}
    if setup.world:
        about["world"] = setup.world
    with Recording(setup.recording, trial.controller, about) if setup.recording else nullcontext() as recording:
        recorder = _TrialRecorder(plant, trial.hand, recording)
        options = Options(desired=setup.commander(plant, trial.hand)) if setup.commander else None
        trial.run(recorder, lambda step: done(step, plant), options)
    if recording and recording.trouble:
        raise RecordingError(recording.trouble)
    return Record(
        recorder.steps,
        np.array([t for t, _ in plant.true_log]),
        np.array([f for _, f in plant.true_log]),
        plant.touches,
        np.array(recorder.hand_position),
    )
