"""Restriction of the body's approach to obstacles, as rows G qd <= h of the QP: eqs. 5-7, and the interface."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from pretouch.compiled import kernel
from pretouch.composition import Part
from pretouch.control.joint_box import JointLimits
from pretouch.errors import ParameterError
from pretouch.params import BrakingParams, RestrictionParams, TaskParams
from pretouch.records import Cell, IntCell
from pretouch.robot.kinematics import Chain, Kinematics, row_along
from pretouch.robot.model import RobotModel
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray, Number, Obstacles, RobotState
from pretouch.values import value


@value
class MotionBody:
    """Constants of a restriction's steps."""

    model: RobotModel
    units: int
    """Number of units of the skin."""
    limits: JointLimits
    task: TaskParams


class MotionRequest(NamedTuple):
    """Motion that the QP of one step aims at."""

    velocity: Annotated[FloatArray, 3]
    """(3,) velocity of the end-effector origin [m/s]."""
    goal: Annotated[FloatArray, 3, 3]
    """(3, 3) R_O_ee to hold, if the task holds an orientation."""
    qd: Annotated[FloatArray, "n"]
    """(n,) joint velocities [rad/s]."""
    by_joints: IntCell
    """1 if the joint velocities replace the velocity, within the same limits."""
    hold: IntCell
    """1 if the arm brakes in place of any motion."""
    advances: IntCell
    """1 if the phase advances with the motion."""
    touch_m_s: Cell
    """Speed at which an arm that a contact moves may touch obstacles [m/s]; approaching ones then do not drive it
    away. NaN: the speed of the profile."""
    untouched: IntCell
    """`Obstacles.slot` from which obstacles must not be touched at any speed."""


@value
class Restricted:
    """Result of a restriction: R rows G @ qd <= h of the QP, and optional other limits."""

    G: FloatArray
    """(R, n) approach velocity of a body point per joint velocity [m]."""
    h: FloatArray
    """(R,) largest approach velocity [m/s]; negative asks for a retreat."""
    which: IntArray
    """(K',) obstacle of each of the first K' rows; the rows after them belong to no obstacle."""
    weight: float
    """Weight of a row's squared violation against the squared task error of eq. 2, both in (m/s)^2; 0: the rows are
    hard, and the arm brakes where the joint box is incompatible with them."""
    velocity: FloatArray | None = None
    """(3,) added to the desired velocity of the end-effector origin [m/s]."""
    speeds: tuple[FloatArray, FloatArray] | None = None
    """(n,) least and (n,) largest joint velocities [rad/s]; acceleration limits come first."""


class ConstraintRows(NamedTuple):
    """Rows of the QP for compiled code, see `Restricted`."""

    G: FloatArray
    h: FloatArray
    which: IntArray
    weight: float


def rows_of(allowed: Restricted, n: int) -> tuple[ConstraintRows, tuple[FloatArray, FloatArray]]:
    """Return rows and joint speeds for compiled code, (0,) each for free speeds; wrong shapes are a ParameterError.

    Other types or memory orders would be compiled anew, while the arm waits.
    """
    count, obstacles, free = len(allowed.h), len(allowed.which), np.zeros(0)
    if allowed.G.shape != (count, n) or obstacles > count:
        shapes = f"G {allowed.G.shape}, h {allowed.h.shape}, which {allowed.which.shape}"
        raise ParameterError(f"A restriction's rows are {shapes}: G is (R, {n}), h is (R,), which is at most (R,).")
    G, h, slowest, fastest = (
        np.ascontiguousarray(part, float) for part in (allowed.G, allowed.h, *(allowed.speeds or (free, free)))
    )
    return ConstraintRows(G, h, np.ascontiguousarray(allowed.which, WHOLE), float(allowed.weight)), (slowest, fastest)


class Restriction(Part, group="pretouch.restrictions"):
    """Restricts the motion of the body near obstacles. A part is a frozen dataclass of its parameters."""

    def init(self, body: MotionBody) -> Any:
        """Return the state before the first step; None without one."""
        return None

    def step(
        self, state: Any, body: MotionBody, kin: Kinematics, robot: RobotState, near: Obstacles, request: MotionRequest
    ) -> tuple[Restricted, Any]:
        """Return the limits of one step, and the state after it.

        Args:
            state: after the step before.
            body: constants.
            kin: posture.
            robot: state of the arm.
            near: obstacles.
            request: motion of the step.
        """
        raise NotImplementedError


@kernel
def _sigmoid(v_max: float, exponent: Number) -> Number:
    # beyond +-500 the result is 0 or v_max to the last digit, and exp does not overflow
    return v_max / (1.0 + np.exp(np.minimum(np.maximum(exponent, -500.0), 500.0)))


@kernel
def velocity_a(d: Number, v_max: float, beta: float, d_crit: float) -> Number:
    """V_a = V_max / (1 + exp(beta (2 d / d_crit - 1))) [m/s], eq. 5 of the paper. `d` [m] is from the surface."""
    return _sigmoid(v_max, beta * (2.0 * d / d_crit - 1.0))  # beta < 0: from about 0 at the surface to V_max at d_crit


@kernel
def velocity_b(d: Number, v_max: float, beta: float, d_crit: float, d_notice: float) -> Number:
    """V_b = V_max / (1 + exp(beta (2 (d - d_crit) / (d_notice - d_crit) - 1))) [m/s], eq. 6 of the paper."""
    return _sigmoid(v_max, beta * (2.0 * (d - d_crit) / (d_notice - d_crit) - 1.0))


@kernel
def approach_limit(d: float, p: RestrictionParams) -> float:
    """Largest approach velocity of the closest point [m/s], eq. 7 of the paper; infinite: no restriction.

    V_a - V_max below d_repulse, V_b from there to d_notice. `d` [m] is from the body's surface and may be negative. The
    limit never lies below the floor.
    """
    if not d < p.d_notice_m:
        return np.inf  # no gradual end: just below, V_b allows V_max
    if d < p.d_repulse_m:
        # never positive: the point has to retreat, at V_max in penetration; with a floor it may come on all the same
        return max(velocity_a(d, p.v_max_m_s, p.beta, p.d_crit_m) - p.v_max_m_s, p.floor_m_s)
    # both cases meet near 0 only if d_repulse is d_crit, as in Table I; otherwise the limit jumps between them
    return max(velocity_b(d, p.v_max_m_s, p.beta, p.d_crit_m, p.d_notice_m), p.floor_m_s)


def row_numbers(params: RestrictionParams) -> Any:
    """Return the numbers of eqs. 5-7: a floor of -inf stands for no floor, and the weight 0 for hard rows."""
    floor = params.floor_m_s if params.rows == "floor" else -np.inf
    return params.numbers._replace(floor_m_s=floor, slack_weight=0.0 if params.rows == "hard" else params.slack_weight)


@kernel
def approach_rows(kin: Kinematics, moved_by: BoolArray, near: Obstacles, p: RestrictionParams) -> ConstraintRows:
    """Rows d^T J_c qd <= x_a for all obstacles within d_notice.

    J_c is the Jacobian of the closest body point, d the direction from it to the obstacle; `moved_by` (L, n) says
    which joint moves which link. The parameters are those that `row_numbers` returns.
    """
    n, count = len(kin.anchor), 0
    chain = Chain(kin.anchor, kin.axis, moved_by, np.zeros(n))
    G, h, which = np.empty((len(near.unit), n)), np.empty(len(near.unit)), np.empty(len(near.unit), np.int64)
    for k in range(len(near.unit)):
        limit = approach_limit(near.body_distance[k], p)
        if limit == np.inf:
            continue
        h[count], which[count] = limit, k
        row_along(chain, near.link[k], near.body_point[k], near.direction[k], G[count])
        count += 1
    return ConstraintRows(G[:count], h[:count], which[:count], p.slack_weight)


@dataclass(frozen=True)
class ApproachRestriction(RestrictionParams, Restriction, name="paper"):
    """Restriction of the body's approach to obstacles, as in the paper (eqs. 5-7); compiled in `line`."""


def notice_m(part: Restriction | None) -> float:
    """Return the body distance from which a restriction allows any motion [m]: its own, or Table I's."""
    return float(getattr(part, "d_notice_m", ApproachRestriction.d_notice_m))


@dataclass(frozen=True)
class BrakingCurve(BrakingParams, Restriction, name="braking"):
    """Limit on the approach speed, so that the arm can stop, or touch gently; compiled in `line`."""
