"""All calls into Pretouch: the arm of the problem, and our two contenders."""

from dataclasses import replace
from importlib.metadata import version
from typing import NamedTuple

import mujoco
import numpy as np
from lab.peers import problem as posed
from lab.peers.problem import Arm, Array, Problem

from pretouch.compiled import compiled
from pretouch.control.active_set import minimise_within
from pretouch.control.approach import approach_rows, row_numbers
from pretouch.control.joint_box import JointLimits, joint_box
from pretouch.control.penalty import Minimum, QuadraticProgram
from pretouch.control.task import cost_into
from pretouch.controller import Controller
from pretouch.modes import SOLVED
from pretouch.params import RestrictionParams, TaskParams
from pretouch.perception.closest import closest
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import profile
from pretouch.robot.body import Capsules, placed
from pretouch.robot.description import panda
from pretouch.robot.kinematics import Hinges, Kinematics, jacobian_into, place
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray, IntArray, RangeStatus, no_obstacles
from pretouch_lab.bench.workload import Workload

VERSIONS = {name: version(name) for name in ("pretouch", "mujoco-core", "numba", "numpy")}
_SETTLE = 50
"""Cycles after the force window is full, in which the arm accelerates."""


def panda_arm() -> tuple[Arm, Array]:
    """Return the Panda of Pretouch in the format of the problem, and its ready position (n,) [rad]."""
    description = panda()
    model = RobotModel(description)
    mj = mujoco.MjModel.from_xml_path(str(description.mjcf))
    T_joint, joint = np.tile(np.eye(4), (mj.nbody, 1, 1)), np.full(mj.nbody, -1)
    placement = []
    for body in range(1, mj.nbody):
        T, parent = np.eye(4), mj.body_parentid[body]
        R = np.empty(9)
        mujoco.mju_quat2Mat(R, mj.body_quat[body])
        T[:3, :3], T[:3, 3] = R.reshape(3, 3), mj.body_pos[body]
        T_joint[body], joint[body] = T_joint[parent] @ T, joint[parent]
        if mj.body_jntnum[body]:
            # a joint's frame is its body's: Panda's joints turn about z through the origin
            placement.append(T_joint[body].copy())
            T_joint[body], joint[body] = np.eye(4), joint[parent] + 1
    body = model.body
    T = T_joint[body.link]
    a, b = (np.einsum("cij,cj->ci", T[:, :3, :3], end) + T[:, :3, 3] for end in (body.a, body.b))
    limits = model.q_min, model.q_max, description.qd_max, description.qdd_max
    capsules = joint[body.link], a, b, body.radius
    return Arm(str(description.mjcf), np.array(placement), T_joint[model.ee], *limits, *capsules), description.q_ready


class _Fixed(NamedTuple):
    """Values that are equal in all snapshots."""

    hinges: Hinges
    moved_by: BoolArray
    ee: int
    body: Capsules
    limits: FloatArray
    q_mid: FloatArray
    cost: TaskParams
    approach: RestrictionParams
    units: IntArray


@compiled
def _solve(q: Array, qd: Array, points: Array, velocity: Array, fixed: _Fixed, kin: Kinematics, x: Array) -> bool:
    """Write the joint velocities (n,) of a snapshot; return True if the program was solved."""
    n, near = len(q), no_obstacles(len(points))
    place(fixed.hinges, q, kin)
    near.unit[:], near.point[:], near.direction[:, 2] = fixed.units, points, 1.0
    closest(placed(fixed.body, kin), near)
    rows = approach_rows(kin, fixed.moved_by, near, fixed.approach)
    lower, upper, _ = joint_box(q, qd, fixed.limits)
    J, H, f = np.empty((6, n)), np.empty((n, n)), np.empty(n)
    jacobian_into(kin.anchor, kin.axis, fixed.moved_by[fixed.ee], kin.position[fixed.ee], J)
    cost_into(J[:3], velocity, q, fixed.q_mid, fixed.cost, np.empty(0), H, f)
    least = Minimum(x, np.empty(len(rows.h)), np.empty(n + len(rows.h)))
    return minimise_within(QuadraticProgram(H, f, lower, upper, rows.G, rows.h, rows.weight), 500, least) == SOLVED


class Rows:
    """Contender that solves the problem in one compiled call: kinematics, closest points, rows, joint box and QP."""

    def __init__(self, problem: Problem) -> None:
        self.problem, model, arm = problem, RobotModel(panda()), problem.arm
        limits = JointLimits(arm.q_min, arm.q_max, arm.qd_max, arm.qdd_max, posed.PERIOD_S)
        cost = TaskParams(
            damping_max=posed.DAMPING_MAX,
            manipulability_threshold=posed.MANIPULABILITY,
            mid_joint_gain=posed.MID_JOINT_GAIN,
            mid_joint_time_s=posed.MID_JOINT_TIME_S,
        )
        approach = RestrictionParams(
            rows="hard",
            v_max_m_s=posed.V_MAX_M_S,
            beta=posed.BETA,
            d_repulse_m=posed.D_REPULSE_M,
            d_crit_m=posed.D_CRIT_M,
            d_notice_m=posed.D_NOTICE_M,
        )
        self.kin = model.kinematics(problem.q[0])
        numbers = limits.table, model.q_mid, cost.numbers, row_numbers(approach)
        arm_of = model.hinges, model.moved_by, model.ee, model.body
        self.fixed = _Fixed(*arm_of, *numbers, np.arange(problem.points.shape[1]))

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p, x = self.problem, np.empty(len(self.fixed.q_mid))
        if not _solve(p.q[s], p.qd[s], p.points[s], p.velocity[s], self.fixed, self.kin, x):
            raise RuntimeError(f"The program of snapshot {s} has no solution.")
        return x


class Step:
    """Contender that runs a whole control step of `pretouch bench cycle` with K units, for K = 0 without readings.

    Beside the rows it examines the inputs, locates the points (eq. 1), leaves out views of the arm itself, tracks
    points and silent units, filters the force, detects contacts, chooses the mode and follows the path. Rows are soft.
    A step is a pure function, so it can be repeated from its state and inputs.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, model, count = problem, RobotModel(panda()), problem.points.shape[1]
        paper = profile("paper:approach.rows=slack")
        work = Workload(model, count or 7, paper, seed=0)
        self.controller = Controller(model, work.skin, no_fixtures(), work.path, paper)
        state, self.turns = self.controller.init(work.inputs().robot), []
        first = paper.window.samples + _SETTLE
        for cycle in range(first + len(problem.q)):
            inputs = work.inputs()
            if not count:
                none, status = np.full(7, np.nan), np.full(7, int(RangeStatus.SIGNAL))
                inputs = replace(inputs, readings=replace(inputs.readings, distance=none, status=status))
            if cycle >= first:
                self.turns.append((state, inputs))
            step, state = self.controller.step(state, inputs)
            work.move(step.command)

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one step."""
        step, _ = self.controller.step(*self.turns[s])
        if step.mode.value != "track":
            raise RuntimeError(step.reason)
        return step.command


CONTENDERS = {"ours, rows": Rows, "ours, whole step": Step}
