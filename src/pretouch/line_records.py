"""Records of a control step: constants, memory, and the values of the step itself; see `line`."""

from typing import Annotated, NamedTuple

from pretouch.contact.residual_model import SequentialNumbers, SequentialState
from pretouch.contact.sequential_step import SampleTest
from pretouch.contact.virtual_mass import VirtualMass
from pretouch.contact.window import Window
from pretouch.control.approach import MotionRequest
from pretouch.control.braking import BrakingNumbers, Slots
from pretouch.control.motion import MotionAnswer, MotionNumbers
from pretouch.control.path import OnPath, PathPace
from pretouch.faults import Watched
from pretouch.params import FailureParams, RestrictionParams, ThresholdParams, WindowParams
from pretouch.perception.local_map import LocalMap
from pretouch.perception.obstacles import Sight, TrackState
from pretouch.perception.perceive import PerceivedScene, Readings
from pretouch.records import Cell
from pretouch.robot.kinematics import Hinges, Kinematics, Mechanism
from pretouch.types import FloatArray, Report

PYTHON, THRESHOLDS, SEQUENTIAL = range(3)
"""Kinds of contact detectors."""
NO_ROWS, PAPER, BRAKING = range(1, 4)
"""Kinds of restrictions, beside PYTHON."""
DECAY, ADMITTANCE = 1, 2
"""Kinds of reactions, beside PYTHON."""


class Kinds(NamedTuple):
    """Kinds of the parts of a profile; PYTHON is a part that is not compiled."""

    detect: int
    approach: int
    react: int


class Fixed(NamedTuple):
    """Constants of all control steps."""

    kinds: Kinds
    hinges: Hinges
    mechanism: Mechanism
    qd_max: Annotated[FloatArray, "n"]
    """(n,) joint velocity limits [rad/s]."""
    failure: FailureParams
    sight: Sight
    window: WindowParams
    filtered: bool
    """True if the thresholds apply to the newest value of the window, not to the force itself."""
    thresholds: ThresholdParams
    test: SequentialNumbers
    no_gain: Annotated[FloatArray, "L"]
    """(L,) factor 1 on the prior of a contact on each link, for steps in which no unit is touched."""
    notes_path: bool
    """True if joint positions along the path are noted, so that the arm can open a pinch."""
    end_m: float
    """Length of an open path, infinite of a closed one [m]."""
    slow_m: float
    """Distance d_max of eq. 3, 0 where nothing slows the arm [m]."""
    paper: RestrictionParams
    """Numbers of eqs. 5-7, see `row_numbers`."""
    braking: BrakingNumbers
    motion: MotionNumbers


class Remembered(NamedTuple):
    """Memory of the compiled line."""

    watch: Watched
    tracks: TrackState
    places: LocalMap
    source_stamp: Cell
    """Stamp of the newest points of outside sources [s]: -inf before the first, NaN without a source so far."""
    window: Window
    test: SequentialState
    mass: VirtualMass
    pace: PathPace
    slots: Slots
    null_velocity: Annotated[FloatArray, "n"]
    """(n,) desired joint velocity in the null space [rad/s]."""
    command: Annotated[FloatArray, "n"]
    """(n,) last joint velocity command [rad/s]."""
    rotation_goal: Annotated[FloatArray, 3, 3]
    """(3, 3) R_O_ee at the start, which the task may hold."""


class Now(NamedTuple):
    """Values of one step."""

    stamp: Cell
    robot: Report
    readings: Readings
    kin: Kinematics
    ee: Annotated[FloatArray, 3]
    """(3,) end-effector origin [m]."""
    scene: PerceivedScene
    filtered_force: Annotated[FloatArray, 3]
    """(3,) the newest value of the window [N]."""
    detection: SampleTest
    """Result of the detector. Moving thresholds give their bands, and the force as a part of its band as the ratio."""
    path: OnPath
    request: MotionRequest
    answer: MotionAnswer
