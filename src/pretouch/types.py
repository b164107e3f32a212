"""The values that travel along the line from a reading to a joint velocity.

All are set once, when they are made; arrays are read and not written to (`docs/reference/conventions.md`).
"""

from collections.abc import Callable
from dataclasses import field
from typing import Annotated, Any, NamedTuple

import numpy as np

from pretouch.compiled import compiled
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
    """(K,) index of the sensing unit in the skin; from their number on, of an outside point, then a moving fixture."""
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


@compiled
def no_obstacles(count: int = 0) -> Obstacles:
    """Return no obstacles, with room for so many."""
    of_each, points = np.zeros(count), np.zeros((count, 3))
    return Obstacles(
        np.zeros(count, np.int64), points, of_each, points.copy(), np.zeros(count, np.int64), points.copy(),
        of_each.copy(), of_each.copy(),
    )  # fmt: skip


@compiled
def some_of(obstacles: Obstacles, first: int, end: int) -> Obstacles:
    """Return obstacles from the first up to, and without, the end, as views."""
    o, m = obstacles, slice(first, end)
    return Obstacles(
        o.unit[m], o.point[m], o.ee_distance[m], o.body_point[m], o.link[m], o.direction[m], o.body_distance[m],
        o.closing_speed[m],
    )  # fmt: skip


class Report(NamedTuple):
    """As `RobotState`; a wrench of NaN is none."""

    stamp: Cell
    q: Annotated[FloatArray, "n"]
    qd: Annotated[FloatArray, "n"]
    q_commanded: Annotated[FloatArray, "n"]
    qd_commanded: Annotated[FloatArray, "n"]
    tau_ext: Annotated[FloatArray, "n"]
    wrench: Annotated[FloatArray, 6]


class Thresholds(NamedTuple):
    """Contact thresholds of the three axes (eq. 9) and what they are made of. All (3,) [N], base frame."""

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
    """A contact found in one step."""

    force: FloatArray
    """(3,) external force F_ext = F_reading - mu of eq. 12 [N], base frame."""
    axes: BoolArray
    """(3,) axes whose threshold was crossed."""


class Touched(NamedTuple):
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


class _LookedUp:
    """A value whose fields are looked up in the numbers of a step when they are first asked for."""

    __slots__ = ("_mode", "_now")

    _now: Flat
    _mode: ModeState

    def __getattr__(self, name: str) -> Any:
        """Look a field up that nobody has set."""
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

    @classmethod
    def of(cls, now: Flat, mode: ModeState, **known: Any) -> "ControlStep":
        """Return the step of such numbers, see `line_records.Now`, and a mode; `known` are fields of other values."""
        step = object.__new__(cls)
        step._now, step._mode = now, mode
        for name, number in known.items():
            setattr(step, name, number)
        return step

    @property
    def limited(self) -> Limited:
        """What keeps the arm from what is asked, and what is left of it."""
        return limited_by(self)


def _obstacles(now: Flat) -> Obstacles:
    count = now.get("seen.all")
    return Obstacles(*(now.get(f"seen.near.{name}")[:count] for name in Obstacles._fields))


def _solution(now: Flat) -> QpSolution:
    seen, qd = now.get("answer.seen"), now.get("answer.command")
    slack, multipliers = now.get("answer.slack")[:seen], now.get("answer.multipliers")[: len(qd) + seen]
    how = outcome_of(bool(now.get("request.hold")), now.get("answer.ending"), bool(now.get("answer.violated")))
    return QpSolution(qd, slack, multipliers, *how)


_PLACES: dict[str, Callable[[Flat], Any]] = {
    name: lambda now, path=path: now.get(path)
    for name, path in {
        "stamp": "stamp", "q": "robot.q", "q_commanded": "robot.q_commanded", "ee_position": "ee",
        "path_position": "path.point", "path_phase": "path.phase", "desired_velocity": "request.velocity",
        "speed_scale": "path.scale", "range_distance": "seen.distance", "filtered_force": "filtered_force",
        "command": "answer.command",
        "residual": "detection.residual", "evidence": "detection.log_likelihood_ratio",
        "detectable_n": "detection.detectable_n",
    }.items()
} | {
    "ee_velocity": lambda now: now.get("answer.velocities")[0], "obstacles": _obstacles,
    "force": lambda now: now.get("robot.wrench")[:3], "thresholds": lambda now: Thresholds(*now.get("detection.bands")),
    "armed": lambda now: True, "contact": lambda now: None, "reaction_velocity": lambda now: np.zeros(3),
    "restricted": lambda now: now.get("answer.which")[: now.get("answer.seen")],
    "approach_limit": lambda now: now.get("answer.limit")[: now.get("answer.seen")], "qp": _solution,
    "touched": lambda now: NOT_TOUCHED,
}  # fmt: skip
"""Where each field is found that a step in one call leaves to be looked up."""
