"""Joint velocities with anticipation: the rows and null space of `AnticipationParams` in place of eqs. 5-7.

As in `joint_motion`, everything is done in one compiled call, made of the functions that are tested alone.
"""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import factor
from pretouch.compiled import entry, flattened
from pretouch.control.blocked import time_blocked
from pretouch.control.braking import Mass, Slots, braking_rows, slots_init
from pretouch.control.joint_box import box_and_brake
from pretouch.control.motion import Motion, how_it_ended, joint_motion
from pretouch.control.null_space import away, cost_with_null_space
from pretouch.control.penalty import SOLVED, Minimum, Problem, excesses, minimise
from pretouch.control.qp import Cost, solve
from pretouch.control.restriction import ApproachRows, Rows, approach_rows
from pretouch.control.setup import (
    NO_JOINTS,
    Asked,
    MotionNumbers,
    MotionRequest,
    MotionSetup,
    NearSettings,
    touching_at,
)
from pretouch.control.task import twist
from pretouch.groups import Arm, Chain, JointArrays, ObstacleArrays
from pretouch.robot.model import Kinematics, RobotModel, jacobian_into
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, QpSolution, RobotState
from pretouch.values import value


@value
class NearState:
    """What anticipation remembers from one step to the next."""

    slots: Slots
    """Rows of the units, see `control.braking`."""
    null_velocity: FloatArray
    """(n,) joint velocity asked for in the null space [rad/s]."""
    blocked: float
    """How long the arm has been kept from its path [s]."""


_ROWS_A_UNIT = 10
"""One of what it sees and one that fades, and four across the normal of each."""
_NO_NUMBERS = np.zeros((0, 0))


def near_init(model: RobotModel, units: int) -> NearState:
    """Return the state with nothing near an arm with a skin of so many units."""
    return NearState(slots_init(units), np.zeros(model.n), 0.0)


def widened(state: NearState, units: int) -> NearState:
    """Return the state with room for so many units, those there were first."""
    half = len(state.slots.link) // 2
    if half >= units:
        return state
    slots = slots_init(units)
    for wider, known in zip(slots, state.slots, strict=True):
        wider[:half], wider[units : units + half] = known[:half], known[half:]
    return NearState(slots, state.null_velocity, state.blocked)


def near_motion(
    state: NearState, setup: MotionSetup, kin: Kinematics, robot: RobotState, obstacles: Obstacles,
    request: MotionRequest,
) -> tuple[Motion, NearState]:  # fmt: skip
    """Joint velocities that track the task within joint limits and what nearness allows, and what to remember.

    As `joint_motion`, whose answer it is for a profile without anticipation.
    """
    settings, model, profile = setup.near, setup.model, setup.profile
    if settings is None:
        return joint_motion(setup, kin, robot, obstacles, request), state
    r, n = profile.restriction, model.n
    mass, counts = _NO_NUMBERS, False
    if settings.braking:
        room = _ROWS_A_UNIT * (len(state.slots.link) // 2)
        G, h, which = np.empty((room, n)), np.empty(room), np.empty(len(obstacles.unit), WHOLE)
        if len(obstacles.unit) and profile.anticipation.effective_mass:
            counts = True
            mass = model.mass_matrix(robot.q) + setup.rotors
    else:
        rows, which = approach_rows(kin, model.moved_by, obstacles, r)
        G, h, room = rows.G, rows.h, len(rows.h)
    link, limit, across, normal, point = state.slots
    slots = Slots(link.copy(), limit.copy(), across.copy(), normal.copy(), point.copy())
    null_velocity, cost = state.null_velocity.copy(), Cost(np.empty((n, n)), np.empty(n))
    qd, slack, multipliers, velocities = np.empty(n), np.empty(room), np.empty(n + room), np.empty((2, 3))
    o, fields = obstacles, setup.near_fields
    if request.touch is not None:
        fields = flattened(model.arm, setup.numbers, touching_at(settings, request.touch))
    seen, ending, violated, blocked = _near_motion.flat(
        robot.q, robot.qd, robot.q_commanded, robot.qd_commanded,
        o.unit, o.link, o.body_point, o.direction, o.body_distance, o.closing_speed,
        request.velocity, request.rotation_goal, request.hold, request.tracks,
        request.qd is not None, NO_JOINTS if request.qd is None else request.qd,
        *slots, null_velocity, state.blocked, counts, mass,
        G, h, which, cost.H, cost.f, qd, slack, multipliers, velocities, *kin, *fields,
    )  # fmt: skip
    after = NearState(slots, null_velocity, blocked)
    if violated and r.mode == "hard" and not request.hold:
        lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, setup.limits.table)
        hard = ApproachRows(G, h, soft=False)
        qp = solve(cost, lower, upper, hard, r.slack_weight, stop, profile.failure.solver_iterations)
        return Motion(qp, which, h, velocities[0], model.ee_jacobian(kin)[:3] @ qp.qd), after
    outcome = how_it_ended(request.hold, ending, violated)
    qp = QpSolution(qd, slack[:seen], multipliers[: n + seen], *outcome)
    return Motion(qp, which[:seen], h[:seen], velocities[0], velocities[1]), after


class _Numbers(NamedTuple):
    motion: MotionNumbers
    near: NearSettings


class _Other(NamedTuple):
    null_velocity: FloatArray
    """(n,) asked for in the null space [rad/s]."""
    blocked: float
    """How long the arm has been kept from its path [s]."""
    mass_counts: bool
    """Whether the touch speed follows from the arm's mass."""
    mass: FloatArray
    """(n, n) mass matrix, if so [kg m^2]."""


class _Memory(NamedTuple):
    """What is changed, and the arm's mass."""

    slots: Slots
    other: _Other


class _Room(NamedTuple):
    """Room for the answer, and for R rows, K of them of what is seen."""

    G: FloatArray
    """(R, n) rows; given, but for those of the braking curve."""
    h: FloatArray
    """(R,) likewise."""
    which: IntArray
    """(K,) likewise: obstacles that restrict the arm."""
    H: FloatArray
    """(n, n) of the cost."""
    f: FloatArray
    """(n,) of the cost."""
    qd: FloatArray
    """(n,) the answer [rad/s]."""
    slack: FloatArray
    """(R,) violation of each row [m/s]."""
    multipliers: FloatArray
    """(n + R,) of box and rows."""
    velocities: FloatArray
    """(2, 3) of the end-effector origin, measured and answered [m/s]."""


@entry
def _near_motion(
    robot: JointArrays, obstacles: ObstacleArrays, asked: Asked, memory: _Memory, room: _Room, kin: Kinematics,
    arm: Arm, numbers: _Numbers,
) -> tuple[int, int, bool, float]:  # fmt: skip
    """Write the answer, and change what is remembered.

    Returns how many rows are of what is seen, how the solver ended, whether any row is violated, and for how long the
    path has been blocked [s].
    """
    p, near, slots, null_velocity = numbers.motion, numbers.near, memory.slots, memory.other.null_velocity
    n, seen, found = len(robot.q), len(room.h), len(room.h)
    if near.braking:
        L = np.eye(n)
        mass = Mass(memory.other.mass_counts and factor(memory.other.mass, L), L)
        chain = Chain(kin.anchor, kin.axis, arm.moved_by, robot.qd_commanded)
        rows = Rows(room.G, room.h, room.which)
        seen, found = braking_rows(slots, obstacles, chain, mass, near.touching, near.limits, rows)
    G, h, which, slack = room.G[:found], room.h[:found], room.which[:seen], room.slack[:found]
    if near.moves_away:
        null_velocity[:] = away(null_velocity, G[:seen], which, obstacles, arm.moved_by, near.away)
    J = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], J)
    lower, upper, stop = box_and_brake(robot.q_commanded, robot.qd_commanded, p.limits)
    H, f, qd, multipliers = room.H, room.f, room.qd, room.multipliers
    if asked.by_joint:
        H[:], f[:] = np.eye(n), -asked.joints
    elif not asked.hold:
        m = 6 if p.holds_orientation else 3
        x_d = twist(asked.velocity, kin.rotation[arm.ee], asked.rotation_goal, p.orientation_gain_1_s)
        H[:], f[:] = cost_with_null_space(J[:m], x_d[:m], robot.q, p.q_mid, p.cost, near.projected, null_velocity)
    ending = SOLVED
    if not asked.hold:
        minimum = Minimum(qd, slack, multipliers[: n + found])
        ending = minimise(Problem(H, f, lower, upper, G, h, p.row_weight), p.budget, minimum)
    if asked.hold or ending != SOLVED:
        qd[:], multipliers[:] = stop, 0.0
        excesses(G, h, qd, slack)
    velocities = room.velocities
    velocities[0], velocities[1] = J[:3] @ robot.qd, J[:3] @ qd
    blocked = memory.other.blocked
    if asked.tracks and not asked.hold:
        hand, towards = np.empty(seen, np.bool_), np.empty((seen, 3))
        for k in range(seen):
            hand[k] = arm.moved_by[obstacles.link[which[k]]].all()
            towards[k] = obstacles.direction[which[k]]
        blocked = time_blocked(blocked, asked.velocity, velocities[1], towards, h[:seen], hand, near.limits.period_s)
    return seen, ending, bool((slack > 0.0).any()), blocked
