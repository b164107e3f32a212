"""What one control step works on: what is fixed, what is remembered, and what is new; see `line`."""

from typing import Annotated, NamedTuple

from pretouch.contact.residual_model import SequentialNumbers, SequentialState
from pretouch.contact.sequential_step import SampleTest
from pretouch.contact.virtual_mass import FreeMass
from pretouch.contact.window import Window
from pretouch.control.approach import MotionRequest
from pretouch.control.braking import BrakingNumbers, Slots
from pretouch.control.motion import MotionNumbers
from pretouch.faults import Report, Watched
from pretouch.params import (
    FailureParams,
    OutsidePoints,
    PerceptionParams,
    RestrictionParams,
    ThresholdParams,
    WindowParams,
)
from pretouch.perception.external_points import OutsideState
from pretouch.perception.obstacles import TrackState
from pretouch.perception.perceive import Readings
from pretouch.records import Cell, IntCell
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import Hinges, Kinematics, Mechanism
from pretouch.sensing.skin import SkinArrays
from pretouch.types import FloatArray, IntArray, Obstacles

PYTHON, THRESHOLDS, SEQUENTIAL = range(3)
"""What detects a contact."""
NO_ROWS, PAPER, BRAKING = range(1, 4)
"""What restricts the body; PYTHON too."""
DECAY, ADMITTANCE = 1, 2
"""What answers a contact; PYTHON too."""


class Kinds(NamedTuple):
    """Which parts of a profile are compiled."""

    detect: int
    approach: int
    react: int


class Sight(NamedTuple):
    """What is seen with, and what is known to be there."""

    sees: bool
    """Whether there are units to see with."""
    filters: bool
    """Whether readings are explained by what is known to be there."""
    margin_m: float
    """Distance before that from which on a reading is explained by it."""
    memory_s: float
    """Memory of the estimates of closing speeds, 0 where there are none."""
    sigmas: float
    """How many standard deviations of a unit's place are taken off, 0 where all places are exact."""
    arm: Capsules
    """All capsules of the arm."""
    body: Capsules
    """Those that joints move."""
    planes: Annotated[FloatArray, "P", 4]
    """(P, 4) of fixtures."""
    skin: SkinArrays
    perception: PerceptionParams
    outside: OutsidePoints


class ForceNumbers(NamedTuple):
    """What is done with the force."""

    window: WindowParams
    filtered: bool
    """Whether the newest value of the window is held against the thresholds, and not the force itself."""
    thresholds: ThresholdParams


class Fixed(NamedTuple):
    """What does not change from step to step."""

    kinds: Kinds
    hinges: Hinges
    mechanism: Mechanism
    qd_max: Annotated[FloatArray, "n"]
    """(n,) joint velocity limits [rad/s]."""
    failure: FailureParams
    sight: Sight
    force: ForceNumbers
    test: SequentialNumbers
    no_gain: Annotated[FloatArray, "L"]
    """(L,) factor 1 on the prior of a contact on each link: no unit says that it is touched."""
    notes_path: bool
    """Whether the places are noted that the task goes through."""
    end_m: float
    """Length of an open path, infinite of a closed one [m]."""
    slow_m: float
    """Distance d_max of eq. 3, 0 where nothing slows the arm [m]."""
    paper: RestrictionParams
    """Of eqs. 5-7, see `row_numbers`."""
    braking: BrakingNumbers
    motion: MotionNumbers


class Pace(NamedTuple):
    """How far along the path the arm is, and how fast it may go."""

    scale: Cell
    """Factor of eq. 4 when it last fell or kept pace."""
    cycles: IntCell
    """Cycles since then."""
    phase: Cell
    """Arc length travelled [m]."""
    speed: Cell
    """Speed allowed along the path [m/s]."""


class Remembered(NamedTuple):
    """All that the compiled line remembers."""

    watch: Watched
    tracks: TrackState
    outside: OutsideState
    window: Window
    test: SequentialState
    mass: FreeMass
    pace: Pace
    slots: Slots
    null_velocity: Annotated[FloatArray, "n"]
    """(n,) joint velocity asked for in the null space [rad/s]."""
    command: Annotated[FloatArray, "n"]
    """(n,) last joint velocity command [rad/s]."""
    rotation_goal: Annotated[FloatArray, 3, 3]
    """(3, 3) R_O_ee at the start, held if the task asks for it."""


class Seen(NamedTuple):
    """What units and others see, and how well they are heard."""

    distance: Annotated[FloatArray, "K"]
    """(K,) what each reading stands for [m]; NaN where it shows no target."""
    near: Obstacles
    found: IntCell
    """Obstacles that units and outside points show."""
    all: IntCell
    """With the nearest of moving fixtures, behind them."""
    nearest: Cell
    """Distance of the nearest obstacle from the end-effector origin [m]."""
    heard: Cell
    """Factor on the speed for units and outside sources that fall silent."""


class Compared(NamedTuple):
    """The force of a step."""

    filtered: Annotated[FloatArray, 3]
    """(3,) the newest value of the window [N]."""
    compared: Annotated[FloatArray, 3]
    """(3,) what was held against the thresholds [N]."""


class OnPath(NamedTuple):
    """The path at the phase of the step."""

    phase: Cell
    """Arc length travelled along the path [m]."""
    point: Annotated[FloatArray, 3]
    """(3,) where on it the end-effector should be [m]."""
    tangent: Annotated[FloatArray, 3]
    """(3,) unit tangent there."""
    velocity: Annotated[FloatArray, 3]
    """(3,) task velocity x_d, before anything slows it [m/s]."""
    forward: Cell
    """Its speed along the path, before it is limited [m/s]."""
    scale: Cell
    """Factor on the velocity, of eqs. 3 and 4."""


class Answer(NamedTuple):
    """The answer of eq. 2, see `QpSolution`."""

    command: Annotated[FloatArray, "n"]
    velocities: Annotated[FloatArray, 2, 3]
    """(2, 3) of the end-effector origin, measured and commanded [m/s]."""
    which: Annotated[IntArray, "M"]
    limit: Annotated[FloatArray, "M"]
    slack: Annotated[FloatArray, "M"]
    multipliers: Annotated[FloatArray, "n + M"]
    seen: IntCell
    """Rows that are of obstacles."""
    ending: IntCell
    violated: IntCell


class Now(NamedTuple):
    """All that is new in a step."""

    stamp: Cell
    robot: Report
    readings: Readings
    kin: Kinematics
    ee: Annotated[FloatArray, 3]
    """(3,) end-effector origin [m]."""
    seen: Seen
    force: Compared
    detection: SampleTest
    """What the detector makes of it; of moving thresholds the bands are theirs, and the ratio is the force's part."""
    path: OnPath
    request: MotionRequest
    answer: Answer
