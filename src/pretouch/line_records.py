"""What one control step works on: what is fixed, what is remembered, and what is new; see `line`."""

from typing import Annotated, NamedTuple

from pretouch.contact.residual_model import SequentialNumbers, SequentialState
from pretouch.contact.sequential_step import SampleTest
from pretouch.contact.virtual_mass import VirtualMass
from pretouch.contact.window import Window
from pretouch.control.approach import MotionRequest
from pretouch.control.braking import BrakingNumbers, Slots
from pretouch.control.motion import Answer, MotionNumbers
from pretouch.control.path import OnPath, Pace
from pretouch.faults import Watched
from pretouch.params import FailureParams, RestrictionParams, ThresholdParams, WindowParams
from pretouch.perception.external_points import OutsideState
from pretouch.perception.obstacles import Sight, TrackState
from pretouch.perception.perceive import Readings, Seen
from pretouch.records import Cell
from pretouch.robot.kinematics import Hinges, Kinematics, Mechanism
from pretouch.types import FloatArray, Report

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


class Fixed(NamedTuple):
    """What does not change from step to step."""

    kinds: Kinds
    hinges: Hinges
    mechanism: Mechanism
    qd_max: Annotated[FloatArray, "n"]
    """(n,) joint velocity limits [rad/s]."""
    failure: FailureParams
    sight: Sight
    window: WindowParams
    filtered: bool
    """Whether the newest value of the window is held against the thresholds, and not the force itself."""
    thresholds: ThresholdParams
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


class Remembered(NamedTuple):
    """All that the compiled line remembers."""

    watch: Watched
    tracks: TrackState
    outside: OutsideState
    window: Window
    test: SequentialState
    mass: VirtualMass
    pace: Pace
    slots: Slots
    null_velocity: Annotated[FloatArray, "n"]
    """(n,) joint velocity asked for in the null space [rad/s]."""
    command: Annotated[FloatArray, "n"]
    """(n,) last joint velocity command [rad/s]."""
    rotation_goal: Annotated[FloatArray, 3, 3]
    """(3, 3) R_O_ee at the start, held if the task asks for it."""


class Now(NamedTuple):
    """All that is new in a step."""

    stamp: Cell
    robot: Report
    readings: Readings
    kin: Kinematics
    ee: Annotated[FloatArray, 3]
    """(3,) end-effector origin [m]."""
    seen: Seen
    filtered_force: Annotated[FloatArray, 3]
    """(3,) the newest value of the window [N]."""
    detection: SampleTest
    """What the detector makes of it; of moving thresholds the bands are theirs, and the ratio is the force's part."""
    path: OnPath
    request: MotionRequest
    answer: Answer
