"""The values that travel along the line from a reading to a joint velocity.

All are set once, when they are made; arrays are read and not written to (`docs/reference/conventions.md`).
"""

from dataclasses import field
from enum import Enum, IntEnum

import numpy as np

from pretouch.desired import Desired
from pretouch.limited import Limited, limited_by
from pretouch.modes import Event
from pretouch.modes import Mode as Mode
from pretouch.moving_fixtures import MovingFixtures
from pretouch.payload import Payload
from pretouch.values import WHOLE as WHOLE
from pretouch.values import BoolArray as BoolArray
from pretouch.values import FloatArray as FloatArray
from pretouch.values import IntArray as IntArray
from pretouch.values import Number as Number
from pretouch.values import value


class RangeStatus(IntEnum):
    """Range status codes of the VL53L1X (ST, UM2356), and one of ours."""

    OK = 0
    SIGMA = 1
    SIGNAL = 2
    MIN_CLIPPED = 3
    OUT_OF_BOUNDS = 4
    HARDWARE = 5
    NO_WRAP_CHECK = 6
    WRAPPED = 7
    CROSSTALK = 9
    SYNC = 10
    MERGED = 11
    MIN_RANGE = 13
    INVALID = 14
    STUCK = 254
    """Set by whoever receives readings that repeat to the last digit."""
    NONE = 255
    """Set by the driver before the first measurement."""


@value
class RangeReadings:
    """The newest reading of each of K units, in the order of the skin; of one never heard -inf, and status NONE."""

    stamp: FloatArray
    """(K,) instant of each measurement [s]."""
    distance: FloatArray
    """(K,) distance along the beam from the sensor origin [m]; meaningless unless the status says so."""
    status: IntArray
    """(K,) `RangeStatus` codes."""


class TouchStatus(IntEnum):
    """What a unit says of its touch sensor."""

    OK = 0
    FAILED = 1
    """It measures, and what it measures can be no reading: a broken lead."""
    NONE = 255
    """It has none, or none was heard of."""


@value
class TouchReadings:
    """The newest touch reading of each of K sensor units, in the order of the skin.

    A unit without a touch sensor, and one that has never been heard, has stamp -inf and status NONE.
    """

    stamp: FloatArray
    """(K,) instant of each measurement [s]."""
    contact: BoolArray
    """(K,) whether the unit is touched; meaningless unless the status is OK."""
    force: FloatArray
    """(K,) size of the force on it [N], NaN where it is not measured."""
    status: IntArray
    """(K,) `TouchStatus` codes."""


@value
class RobotState:
    """What the robot's own interface reports at one instant, n joints."""

    stamp: float
    """Instant of the measurement [s]."""
    q: FloatArray
    """(n,) measured joint positions [rad]."""
    qd: FloatArray
    """(n,) measured joint velocities [rad/s]."""
    q_commanded: FloatArray
    """(n,) joint positions the robot's motion generator is at [rad] (the vendor's q_d)."""
    qd_commanded: FloatArray
    """(n,) joint velocities the robot's motion generator is at [rad/s] (the vendor's dq_d)."""
    tau_ext: FloatArray
    """(n,) estimated torques by the environment on the joints [Nm]; within a step NaN where the robot gave none."""
    wrench: FloatArray | None
    """(6,) estimated force [N] and torque about the TCP [Nm] **on the robot by the environment**, base frame.

    None where the robot has no estimate, as near a singularity.
    """


@value
class SeenPoints:
    """The newest M points of what outside sources see, such as cameras, in the base frame.

    What a source shows of the arm itself or of fixtures may be in it. A row with a NaN shows nothing.
    """

    heard: float
    """Newest measurement of the source silent for longest [s], -inf before the first; no points: nothing is seen."""
    stamp: FloatArray
    """(M,) instant at which each point was measured [s]."""
    point: FloatArray
    """(M, 3) [m]."""
    sigma: FloatArray
    """(M,) standard deviation of each point in the worst direction, that of the sensor's own pose included [m]."""


@value
class Inputs:
    """All that one control step is given."""

    stamp: float
    """Instant of this step [s]."""
    robot: RobotState
    readings: RangeReadings
    resume: bool = False
    """A person asks to leave a latched HOLD."""
    touch: TouchReadings | None = None
    """What units say of being touched; None of a skin that has no touch sensors."""
    points: SeenPoints | None = None
    """What outside sources see; None without one. Once given, silence of theirs stops the arm."""
    payload: Payload | None = None
    """What the arm carries; None: nothing is said, and what was said last stays."""
    desired: Desired | None = None
    """What a commander asks for, in place of the path; None: the path is followed."""
    moving: MovingFixtures | None = None
    """What is known to move beside the arm; None: nothing is said of any."""


@value
class Obstacles:
    """K sensed points, each with its closest point on the robot's body. Base frame."""

    unit: IntArray
    """(K,) index of the sensing unit in the skin; from their number on, of an outside point, then a moving fixture."""
    point: FloatArray
    """(K, 3) obstacle positions, eq. 1 [m]."""
    ee_distance: FloatArray
    """(K,) distance from the end-effector origin, less the spread, at least 0 [m] (eqs. 3, 11); inf: moving fixture."""
    body_point: FloatArray
    """(K, 3) closest points on the surface of the body [m]."""
    link: IntArray
    """(K,) index of the link that carries the closest point."""
    direction: FloatArray
    """(K, 3) unit vectors from body to obstacle, defined in penetration too."""
    body_distance: FloatArray
    """(K,) signed distance from the body's surface, less the point's spread [m] (eqs. 5-7)."""
    closing_speed: FloatArray
    """(K,) estimated speed of the object itself towards the closest body point [m/s]; 0 where it is not estimated."""


@value
class Thresholds:
    """Contact thresholds of the three axes (eq. 9) and what they are made of. All (3,) [N], base frame."""

    parts: FloatArray
    """(6, 3) all of them, in the order in which they follow."""

    @property
    def upper(self) -> FloatArray:
        """T_u."""
        return self.parts[0]

    @property
    def lower(self) -> FloatArray:
        """T_l."""
        return self.parts[1]

    @property
    def mean(self) -> FloatArray:
        """Mean of the window."""
        return self.parts[2]

    @property
    def sigma(self) -> FloatArray:
        """Standard deviation of the window."""
        return self.parts[3]

    @property
    def obstacle_positive(self) -> FloatArray:
        """F_obs+ of eq. 11: an object at greater coordinate raises the lower threshold by this."""
        return self.parts[4]

    @property
    def obstacle_negative(self) -> FloatArray:
        """F_obs- of eq. 11: an object at smaller coordinate lowers the upper threshold by this."""
        return self.parts[5]


@value
class Contact:
    """A contact found in one step."""

    force: FloatArray
    """(3,) external force F_ext = F_reading - mu of eq. 12 [N], base frame."""
    axes: BoolArray
    """(3,) axes whose threshold was crossed."""


@value
class Touched:
    """Where the arm is touched: C = 1 contact; none where no contact is detected. Base frame."""

    link: IntArray
    """(C,) index of the link that carries each place; links that the same joints move differ in place only."""
    point: FloatArray
    """(C, 3) on the surface of the body [m]."""
    force: FloatArray
    """(C, 3) on the arm [N]."""
    sigma: FloatArray
    """(C,) standard deviation of each place on its body in the worst direction [m]."""
    probability: FloatArray
    """(C,) that it is this rigid body that is touched, from 0 to 1."""


NOT_TOUCHED = Touched(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))
"""No contact is detected. One of these for all steps: its arrays are not written to either."""


class QpOutcome(Enum):
    """How a quadratic program ended."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    """Hard rows contradict the joint box: the answer is the braking command."""
    FAILED = "failed"
    """The solver gave no usable answer: the answer is the braking command."""
    SKIPPED = "skipped"
    """No problem was posed, because the arm holds: the answer is the braking command."""


@value
class QpSolution:
    """The answer to one quadratic program (eq. 2)."""

    qd: FloatArray
    """(n,) joint velocities [rad/s]."""
    slack: FloatArray
    """(K,) by how much each approach row is violated [m/s], zero where it holds."""
    multipliers: FloatArray
    """(n + K,) multipliers of joint box and rows, positive at an upper and negative at a lower bound."""
    outcome: QpOutcome
    status: str
    """What happened, as a sentence."""
    violated: bool = False
    """Whether a solution violates a soft row, also one that belongs to no obstacle."""


@value
class ControlStep:
    """All that one step of the controller saw and decided: what figures and reports read, of any arm."""

    stamp: float
    mode: Mode
    event: Event
    """What made the mode so; of a HOLD that lasts, what began it."""
    detail: str
    """What `reason` says of this step, a part of its sentence."""
    reason: str
    """Why the arm is in this mode, as a sentence (`modes.TABLE`); `explain` says what it does in it."""
    latched: bool
    """Whether the HOLD lasts until a person resumes."""
    q: FloatArray
    """(n,) measured joint positions [rad]."""
    q_commanded: FloatArray
    """(n,) joint positions the robot's motion generator was at [rad]."""
    ee_position: FloatArray
    """(3,) end-effector origin [m]."""
    ee_velocity: FloatArray
    """(3,) measured end-effector velocity [m/s]."""
    path_position: FloatArray
    """(3,) where on the path the arm should be, or where it is while a commander asks [m]."""
    path_phase: float
    """Arc length travelled along the path [m]."""
    desired_velocity: FloatArray
    """(3,) end-effector velocity asked of the QP [m/s]."""
    speed_scale: float
    """Factor on the velocity along the path in [0, 1]: eq. 3 or that of units falling silent, faded by eq. 4."""
    range_distance: FloatArray
    """(K,) distances of the readings used [m], NaN where the unit reported no target."""
    obstacles: Obstacles
    force: FloatArray
    """(3,) the robot's estimate of the external force less an announced load's [N], NaN where it has none."""
    filtered_force: FloatArray
    """(3,) newest value added to the window, eq. 8 [N]."""
    thresholds: Thresholds
    armed: bool
    """Whether the window is full, so that a contact can be detected."""
    contact: Contact | None
    """The contact detected in this very step."""
    reaction_velocity: FloatArray
    """(3,) end-effector velocity of the reaction under way, zero otherwise [m/s]."""
    restricted: IntArray
    """(K',) which of the obstacles restrict the arm."""
    approach_limit: FloatArray
    """(K',) approach limit for each of them, of eq. 7 or in mode braking of the braking curve [m/s]."""
    qp: QpSolution
    command: FloatArray
    """(n,) joint velocity command [rad/s]."""
    residual: FloatArray
    """(n,) external joint torques less what the detector takes for free motion [Nm], NaN where there are none."""
    evidence: float
    """How far the detector is on the way to a contact: one from 1 on, while armed."""
    touched: Touched = field(default_factory=lambda: NOT_TOUCHED)
    """Where the arm is touched; empty where no contact is detected or the profile does not localise."""
    detectable_n: float = np.nan
    """Force at the end-effector that is found, see `Detection.detectable_n` [N]."""

    @property
    def limited(self) -> Limited:
        """What keeps the arm from what is asked, and what is left of it."""
        return limited_by(self)
