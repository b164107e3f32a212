"""The values between a reading and a joint velocity.

Fields are set once, at construction; arrays are read and never written to (`docs/reference/conventions.md`).
"""

from collections.abc import Callable
from dataclasses import field
from typing import Annotated, Any, NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.explanation import SEEN_NOW_S as SEEN_NOW_S
from pretouch.explanation import Limited, limited_by
from pretouch.inputs import SOMEWHERE as SOMEWHERE
from pretouch.inputs import Inputs as Inputs
from pretouch.inputs import MovingFixtures as MovingFixtures
from pretouch.inputs import Payload as Payload
from pretouch.inputs import RangeReadings as RangeReadings
from pretouch.inputs import RangeStatus as RangeStatus
from pretouch.inputs import RobotState as RobotState
from pretouch.inputs import SeenPoints as SeenPoints
from pretouch.inputs import TouchReadings as TouchReadings
from pretouch.inputs import TouchStatus as TouchStatus
from pretouch.modes import Event, ModeState, outcome_of
from pretouch.modes import Mode as Mode
from pretouch.modes import QpOutcome as QpOutcome
from pretouch.records import Cell, Flat
from pretouch.values import WHOLE as WHOLE
from pretouch.values import BoolArray as BoolArray
from pretouch.values import FloatArray as FloatArray
from pretouch.values import IntArray as IntArray
from pretouch.values import Number as Number
from pretouch.values import value


class Obstacles(NamedTuple):
    """K sensed points, each with its closest point on the robot's body. Base frame."""

    unit: Annotated[IntArray, "K"]
    """(K,) index of the sensing unit in the skin; the indices after those are outside points, then moving fixtures."""
    point: Annotated[FloatArray, "K", 3]
    """(K, 3) obstacle positions, eq. 1 [m]."""
    ee_distance: Annotated[FloatArray, "K"]
    """(K,) distance from the end-effector origin, less the spread, at least 0 [m] (eqs. 3, 11); inf: moving fixture."""
    body_point: Annotated[FloatArray, "K", 3]
    """(K, 3) closest points on the surface of the body [m]."""
    link: Annotated[IntArray, "K"]
    """(K,) index of the link that carries the closest point."""
    direction: Annotated[FloatArray, "K", 3]
    """(K, 3) unit vectors from body to obstacle, defined in penetration too."""
    body_distance: Annotated[FloatArray, "K"]
    """(K,) signed distance from the body's surface, less the point's spread [m] (eqs. 5-7)."""
    closing_speed: Annotated[FloatArray, "K"]
    """(K,) estimated speed of the object itself towards the closest body point [m/s]; 0 where it is not estimated."""
    slot: Annotated[IntArray, "K"]
    """(K,) number that an obstacle keeps: of its unit, or where places are remembered of its link and rank."""
    age: Annotated[FloatArray, "K"]
    """(K,) time since the last look that showed it [s]."""


@compiled
def no_obstacles(count: int = 0) -> Obstacles:
    """Return no obstacles, with room for a number of them."""
    index, number, point = np.zeros(count, np.int64), np.zeros(count), np.zeros((count, 3))
    return Obstacles(
        index, point, number, point.copy(), index.copy(), point.copy(), number.copy(), number.copy(), index.copy(),
        number.copy(),
    )  # fmt: skip


@compiled
def some_of(obstacles: Obstacles, first: int, end: int) -> Obstacles:
    """Return views of the obstacles from `first` to before `end`."""
    unit, point, ee, on_body, link, direction, distance, closing, slot, age = obstacles
    m = slice(first, end)
    return Obstacles(
        unit[m], point[m], ee[m], on_body[m], link[m], direction[m], distance[m], closing[m], slot[m], age[m]
    )


class Report(NamedTuple):
    """`RobotState` as a record; a wrench of NaN stands for no estimate."""

    stamp: Cell
    q: Annotated[FloatArray, "n"]
    qd: Annotated[FloatArray, "n"]
    q_commanded: Annotated[FloatArray, "n"]
    qd_commanded: Annotated[FloatArray, "n"]
    tau_ext: Annotated[FloatArray, "n"]
    wrench: Annotated[FloatArray, 6]


class Thresholds(NamedTuple):
    """Contact thresholds of the three axes (eq. 9) and their components. All (3,) [N], base frame."""

    upper: FloatArray
    """T_u."""
    lower: FloatArray
    """T_l."""
    mean: FloatArray
    """Mean of the window."""
    sigma: FloatArray
    """Standard deviation of the window."""
    obstacle_positive: FloatArray
    """F_obs+ of eq. 11: an object at greater coordinate raises the lower threshold by this."""
    obstacle_negative: FloatArray
    """F_obs- of eq. 11: an object at smaller coordinate lowers the upper threshold by this."""


@value
class Contact:
    """A contact that is detected in one step."""

    force: FloatArray
    """(3,) external force F_ext = F_reading - mu of eq. 12 [N], base frame."""
    axes: BoolArray
    """(3,) axes whose threshold was crossed."""


class Touched(NamedTuple):
    """Place and force of a contact: C = 1, or 0 where no contact is detected. Base frame."""

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
"""No contact is detected. All steps share this value: its arrays are never written to."""


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
    """The outcome as a sentence."""
    violated: bool = False
    """True if the solution violates a soft row, also one that belongs to no obstacle."""


class _LookedUp:
    """A value whose fields are read from the record of a step at their first use."""

    __slots__ = ("_mode", "_now")

    _now: Flat
    _mode: ModeState

    def __getattr__(self, name: str) -> Any:
        """Read a field that has not been set."""
        if name in _PLACES:
            number = _PLACES[name](self._now)
        elif name in ModeState.__slots__:
            number = getattr(self._mode, name)
        else:
            raise AttributeError(f"{type(self).__name__} has no {name}")
        setattr(self, name, number)
        return number


@value
class ControlStep(_LookedUp):
    """Perception, decision and command of one control step: the source of figures and reports, for any arm."""

    stamp: float
    mode: Mode
    event: Event
    """Cause of the mode; of a HOLD that lasts, the event at its beginning."""
    detail: str
    """Details of this step, which `reason` contains."""
    reason: str
    """Sentence on the cause of the mode (`modes.TABLE`); `explain` describes the motion in it."""
    latched: bool
    """True if the HOLD lasts until a person resumes."""
    q: FloatArray
    """(n,) measured joint positions [rad]."""
    q_commanded: FloatArray
    """(n,) joint positions the robot's motion generator was at [rad]."""
    ee_position: FloatArray
    """(3,) end-effector origin [m]."""
    ee_velocity: FloatArray
    """(3,) measured end-effector velocity [m/s]."""
    path_position: FloatArray
    """(3,) desired position on the path; the actual position while a commander moves the arm [m]."""
    path_phase: float
    """Arc length travelled along the path [m]."""
    desired_velocity: FloatArray
    """(3,) desired end-effector velocity of the QP [m/s]."""
    speed_scale: float
    """Factor on the velocity along the path in [0, 1]: eq. 3 or that of units falling silent, faded by eq. 4."""
    range_distance: FloatArray
    """(K,) distances of the readings [m], NaN where the unit reported no target."""
    obstacles: Obstacles
    force: FloatArray
    """(3,) the robot's estimate of the external force less an announced load's [N], NaN where it has none."""
    filtered_force: FloatArray
    """(3,) newest value added to the window, eq. 8 [N]."""
    thresholds: Thresholds
    armed: bool
    """True if the force window is full, so that a contact can be detected."""
    contact: Contact | None
    """The contact that is detected in this step."""
    reaction_velocity: FloatArray
    """(3,) end-effector velocity of the reaction under way, zero otherwise [m/s]."""
    restricted: IntArray
    """(K',) indices of the obstacles that restrict the arm."""
    approach_limit: FloatArray
    """(K',) approach limit of each, by eq. 7 or the braking curve [m/s]."""
    qp: QpSolution
    command: FloatArray
    """(n,) joint velocity command [rad/s]."""
    residual: FloatArray
    """(n,) external joint torques less the detector's model of free motion [Nm], NaN without torques."""
    evidence: float
    """Evidence for a contact: from 1 on there is one, while armed."""
    touched: Touched = field(default_factory=lambda: NOT_TOUCHED)
    """Place and force of the contact; empty where none is detected or the profile does not localise."""
    detectable_n: float = np.nan
    """Smallest force at the end-effector that is detected, see `Detection.detectable_n` [N]."""

    @classmethod
    def of(cls, now: Flat, mode: ModeState, **fields: Any) -> "ControlStep":
        """Return the step of a record `line_records.Now` and a mode; `fields` have other values than the record."""
        step = object.__new__(cls)
        step._now, step._mode = now, mode
        for name, number in fields.items():
            setattr(step, name, number)
        return step

    @property
    def limited(self) -> Limited:
        """The limit that keeps the arm from the desired motion, and the part of it that remains."""
        return limited_by(self)


def _obstacles(now: Flat) -> Obstacles:
    count = now.get("scene.total")
    return Obstacles(*(now.get(f"scene.near.{name}")[:count] for name in Obstacles._fields))


def _solution(now: Flat) -> QpSolution:
    rows, qd = now.get("answer.rows"), now.get("answer.command")
    slack, multipliers = now.get("answer.slack")[:rows], now.get("answer.multipliers")[: len(qd) + rows]
    how = outcome_of(bool(now.get("request.hold")), now.get("answer.ending"), bool(now.get("answer.violated")))
    return QpSolution(qd, slack, multipliers, *how)


_PLACES: dict[str, Callable[[Flat], Any]] = {
    name: lambda now, path=path: now.get(path)
    for name, path in {
        "stamp": "stamp", "q": "robot.q", "q_commanded": "robot.q_commanded", "ee_position": "ee",
        "path_position": "path.point", "path_phase": "path.phase", "desired_velocity": "request.velocity",
        "speed_scale": "path.scale", "range_distance": "scene.distance", "filtered_force": "filtered_force",
        "command": "answer.command",
        "residual": "detection.residual", "evidence": "detection.log_likelihood_ratio",
        "detectable_n": "detection.detectable_n",
    }.items()
} | {
    "ee_velocity": lambda now: now.get("answer.velocities")[0], "obstacles": _obstacles,
    "force": lambda now: now.get("robot.wrench")[:3], "thresholds": lambda now: Thresholds(*now.get("detection.bands")),
    "armed": lambda now: True, "contact": lambda now: None, "reaction_velocity": lambda now: np.zeros(3),
    "restricted": lambda now: now.get("answer.which")[: now.get("answer.rows")],
    "approach_limit": lambda now: now.get("answer.limit")[: now.get("answer.rows")], "qp": _solution,
    "touched": lambda now: NOT_TOUCHED,
}  # fmt: skip
"""How each field of a step in one call is read from its record, by the field's name."""
