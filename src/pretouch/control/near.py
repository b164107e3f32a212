"""Joint velocities with anticipation: the rows and null space of `AnticipationParams` in place of eqs. 5-7.

As in `joint_motion`, everything is done in one compiled call, made of the functions that are tested alone.
"""

import numpy as np

from pretouch.cholesky import factor
from pretouch.compiled import compiled
from pretouch.control.blocked import time_blocked
from pretouch.control.braking import braking_rows, slots_init
from pretouch.control.joint_box import JointLimits, box_and_brake
from pretouch.control.motion import Motion, joint_motion
from pretouch.control.null_space import away, cost_with_null_space
from pretouch.control.penalty import SOLVED, excesses, minimise
from pretouch.control.qp import ENDING, Cost, solve
from pretouch.control.restriction import ApproachRows, approach_rows
from pretouch.control.task import twist
from pretouch.control.touch_speed import touch_parameters
from pretouch.params import Profile
from pretouch.robot.model import Kinematics, RobotModel, jacobian_into
from pretouch.types import WHOLE, BoolArray, FloatArray, IntArray, Obstacles, QpOutcome, QpSolution, RobotState
from pretouch.values import value


@value
class NearState:
    """What anticipation remembers from one step to the next."""

    slots: FloatArray
    """(2 K, 9) rows of the units, see `control.braking`."""
    null_velocity: FloatArray
    """(n,) joint velocity asked for in the null space [rad/s]."""
    blocked: float
    """How long the arm has been kept from its path [s]."""


@value
class NearSettings:
    """A profile's numbers as compiled code takes them, made once."""

    rows: FloatArray
    """(13,) of `braking_rows`; the last says whether the arm's mass is to count."""
    touch: FloatArray
    """(4,) of `touch_speed`."""
    null: FloatArray
    """(4,) of `away`: distance [m], speed [m/s], joint velocity [rad/s], its change in a period [rad/s]; or none."""


_CLOSING_DEADBAND = 5
"""Index in `NearSettings.rows` of the closing speed below which none is taken for one."""
_ROWS_A_UNIT = 10
"""One of what it sees and one that fades, and four across the normal of each."""
_NO_MASS, _NO_JOINT = np.zeros((0, 0)), np.zeros(0)


def near_init(model: RobotModel, units: int) -> NearState:
    """Return the state with nothing near an arm with a skin of so many units."""
    return NearState(slots_init(units), np.zeros(model.n), 0.0)


def widened(state: NearState, units: int) -> NearState:
    """Return the state with room for so many units, those there were first."""
    half = len(state.slots) // 2
    if half >= units:
        return state
    slots = slots_init(units)
    slots[:half], slots[units : units + half] = state.slots[:half], state.slots[half:]
    return NearState(slots, state.null_velocity, state.blocked)


def anticipates(profile: Profile) -> bool:
    """Whether a profile asks for anything that `joint_motion` alone does not do."""
    p = profile.anticipation
    return profile.restriction.mode == "braking" or profile.task.mid_joint_projected or p.null_space


def near_settings(profile: Profile) -> NearSettings | None:
    """Return what `near_motion` needs of a profile; None for one without anticipation."""
    if not anticipates(profile):
        return None
    r, p, t = profile.restriction, profile.anticipation, profile.task
    return NearSettings(
        np.array((
            r.d_notice_m, p.deceleration_m_s2, p.latency_s, p.margin_m, p.retreat_max_m_s,
            p.closing_deadband_m_s if p.closing_speed else np.inf,
            p.tangential_distance_m if p.tangential else -np.inf, p.tangential_speed_m_s, t.speed_m_s,
            p.tighten_m_s2, p.loosen_m_s2, t.control_period_s, float(p.effective_mass),
        )),
        touch_parameters(p),
        np.array((p.null_distance_m, p.null_speed_m_s, p.null_joint_rad_s, p.null_rate_rad_s2 * t.control_period_s))
        if p.null_space else _NO_JOINT,
    )  # fmt: skip


def _touching_at(settings: NearSettings, speed: float) -> NearSettings:
    """Return the settings with a touch speed [m/s] whatever the mass, and no heed of what moves by itself."""
    rows = settings.rows.copy()
    rows[_CLOSING_DEADBAND] = np.inf
    return NearSettings(rows, np.array((np.inf, 1.0, 1.0, speed)), settings.null)


def near_motion(
    state: NearState, settings: NearSettings | None, model: RobotModel, kin: Kinematics, robot: RobotState,
    obstacles: Obstacles, velocity: FloatArray, rotation_goal: FloatArray, limits: JointLimits, profile: Profile,
    hold: bool, tracks: bool, reaction_qd: FloatArray | None = None, touch: float | None = None,
) -> tuple[Motion, NearState]:  # fmt: skip
    """Joint velocities that track the task within joint limits and what nearness allows, and what to remember.

    As `joint_motion`, whose answer it is for a profile without anticipation; `settings` are those of the profile, and
    `tracks` says whether the arm follows its path, so that something may block it. `touch` is the speed at which an arm
    that a contact moves may touch what it sees [m/s], and then nothing drives it away from what comes nearer; None for
    what the profile says.
    """
    if settings is None:
        given = (model, kin, robot, obstacles, velocity, rotation_goal, limits, profile, hold, reaction_qd)
        return joint_motion(*given), state
    if touch is not None:
        settings = _touching_at(settings, touch)
    r, t, n = profile.restriction, profile.task, model.n
    braking, mass, soft = r.mode == "braking", _NO_MASS, r.mode != "hard"
    if braking:
        room = _ROWS_A_UNIT * (len(state.slots) // 2)
        G, h, which = np.empty((room, n)), np.empty(room), np.empty(len(obstacles.unit), WHOLE)
        if len(obstacles.unit) and settings.rows[-1] > 0:
            mass = model.mass_matrix(robot.q) + profile.anticipation.rotor_inertia_kg_m2 * np.eye(n)
    else:
        rows, which = approach_rows(kin, model.moved_by, obstacles, r)
        G, h, room = rows.G, rows.h, len(rows.h)
    slots, null_velocity = state.slots.copy(), np.empty(n)
    qd, slack, multipliers, velocities = np.empty(n), np.empty(room), np.empty(n + room), np.empty((2, 3))
    H, f = np.empty((n, n)), np.empty(n)
    seen, ending, violated, blocked = _near_motion(
        slots, null_velocity, state.null_velocity, state.blocked, t.control_period_s,
        kin.position, kin.rotation, kin.anchor, kin.axis, model.moved_by, model.ee,
        robot.q, robot.qd, robot.q_commanded, robot.qd_commanded, mass,
        obstacles.unit, obstacles.link, obstacles.body_point, obstacles.direction, obstacles.body_distance,
        obstacles.closing_speed, settings.rows, settings.touch, settings.null,
        velocity, rotation_goal, model.q_mid, limits.table, r.slack_weight if soft else 0.0,
        t.orientation == "hold", t.orientation_gain_1_s, t.damping_max, t.manipulability_threshold, t.mid_joint_gain,
        t.mid_joint_time_s, t.mid_joint_projected, profile.failure.solver_iterations, braking, hold, tracks,
        _NO_JOINT if reaction_qd is None else reaction_qd, G, h, which, H, f, qd, slack, multipliers, velocities,
    )  # fmt: skip
    after = NearState(slots, null_velocity, blocked)
    if violated and not soft and not hold:
        lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, limits.table)
        hard = ApproachRows(G, h, soft=False)
        qp = solve(Cost(H, f), lower, upper, hard, r.slack_weight, stop, profile.failure.solver_iterations)
        return Motion(qp, which, h, velocities[0], model.ee_jacobian(kin)[:3] @ qp.qd), after
    outcome, status = QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved"
    if hold:
        outcome, status = QpOutcome.SKIPPED, "not posed: the arm holds"
    elif ending != SOLVED:
        outcome, status = QpOutcome.FAILED, ENDING[ending]
    qp = QpSolution(qd, slack[:seen], multipliers[: n + seen], outcome, status)
    return Motion(qp, which[:seen], h[:seen], velocities[0], velocities[1]), after


@compiled
def _near_motion(
    slots: FloatArray, null: FloatArray, null_before: FloatArray, blocked: float, period: float,
    position: FloatArray, rotation: FloatArray, anchor: FloatArray, axis: FloatArray, moved_by: BoolArray, ee: int,
    q: FloatArray, qd: FloatArray, q_commanded: FloatArray, qd_commanded: FloatArray, mass: FloatArray,
    unit: IntArray, link: IntArray, body_point: FloatArray, direction: FloatArray, distance: FloatArray,
    closing: FloatArray, row_settings: FloatArray, touch: FloatArray, null_settings: FloatArray,
    velocity: FloatArray, rotation_goal: FloatArray, q_mid: FloatArray, limits: FloatArray, weight: float,
    keep_orientation: bool, orientation_gain: float, damping_max: float, threshold: float, mid_gain: float,
    mid_time: float, projected: bool, budget: int, braking: bool, hold: bool, tracks: bool, reaction_qd: FloatArray,
    G: FloatArray, h: FloatArray, which: IntArray, H: FloatArray, f: FloatArray, answer: FloatArray,
    slack: FloatArray, multipliers: FloatArray, velocities: FloatArray,
) -> tuple[int, int, bool, float]:  # fmt: skip
    """Change the slots, write `null` and the last two lines of arguments.

    Rows G, h are given but for `braking`. Returns how many are of what is seen, how the solver ended, whether any row
    is violated, and for how long the path has been blocked.
    """
    n, seen, found = len(q), len(h), len(h)
    if braking:
        L, numbers = np.eye(n), row_settings.copy()
        numbers[-1] = 1.0 if len(mass) > 0 and factor(mass, L) else 0.0
        seen, found = braking_rows(
            slots, unit, link, body_point, direction, distance, closing, anchor, axis, moved_by, qd_commanded, L,
            touch, numbers, G, h, which,
        )  # fmt: skip
    G, h, which, slack = G[:found], h[:found], which[:seen], slack[:found]
    null[:] = null_before
    if len(null_settings):
        null[:] = away(
            null_before, G[:seen], which, link, distance, moved_by, null_settings[0], null_settings[1],
            null_settings[2], null_settings[3],
        )  # fmt: skip
    J = np.empty((6, n))
    jacobian_into(anchor, axis, moved_by[ee], position[ee], J)
    lower, upper, stop = box_and_brake(q_commanded, qd_commanded, limits)
    if len(reaction_qd):
        H[:], f[:] = np.eye(n), -reaction_qd
    elif not hold:
        m = 6 if keep_orientation else 3
        x_d = twist(velocity, rotation[ee], rotation_goal, orientation_gain)
        H[:], f[:] = cost_with_null_space(
            J[:m], x_d[:m], q, q_mid, damping_max, threshold, mid_gain, mid_time, projected, null
        )
    ending = SOLVED
    if not hold:
        ending = minimise(H, f, lower, upper, G, h, weight, budget, answer, slack, multipliers[: n + found])
    if hold or ending != SOLVED:
        answer[:], multipliers[:] = stop, 0.0
        excesses(G, h, answer, slack)
    velocities[0], velocities[1] = J[:3] @ qd, J[:3] @ answer
    if tracks and not hold:
        hand, towards = np.empty(seen, np.bool_), np.empty((seen, 3))
        for k in range(seen):
            hand[k], towards[k] = moved_by[link[which[k]]].all(), direction[which[k]]
        blocked = time_blocked(blocked, velocity, velocities[1], towards, h[:seen], hand, period)
    return seen, ending, bool((slack > 0.0).any()), blocked
