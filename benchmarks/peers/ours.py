"""All calls into Pretouch: the arm the problem is posed for, and our two contenders."""

from importlib.metadata import version
from typing import NamedTuple

import mujoco
import numpy as np
from benchmarks.peers.geometry import Arm, Array
from benchmarks.peers.problem import TERMS, Problem

from pretouch.compiled import compiled
from pretouch.control.active_set import minimise_within
from pretouch.control.approach import approach_rows, row_numbers
from pretouch.control.joint_box import JointLimits, joint_box
from pretouch.control.path import segment
from pretouch.control.penalty import Minimum
from pretouch.control.penalty import Problem as Program
from pretouch.control.task import cost_into
from pretouch.controller import Controller, ControllerState
from pretouch.modes import SOLVED
from pretouch.params import RestrictionParams, TaskParams
from pretouch.perception.closest import closest
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import profile
from pretouch.robot.body import Capsules, placed
from pretouch.robot.description import panda
from pretouch.robot.kinematics import Hinges, Kinematics, jacobian_into, place
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, paper_skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import BoolArray, FloatArray, Inputs, IntArray, RangeReadings, RangeStatus, RobotState, no_obstacles

_AT_ONCE = 1000
"""Units that a skin wears, of more than it may have."""
VERSIONS = {name: version(name) for name in ("pretouch", "mujoco-core", "numba", "numpy")}


def panda_arm() -> tuple[Arm, Array]:
    """Read the Panda of Pretouch for everybody else: the arm, and its ready position (n,) [rad]."""
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
    arm = Arm(
        mjcf=str(description.mjcf), placement=np.array(placement), tool=T_joint[model.ee],
        q_min=model.q_min, q_max=model.q_max, qd_max=description.qd_max, qdd_max=description.qdd_max,
        joint=joint[body.link], a=_moved(T_joint[body.link], body.a), b=_moved(T_joint[body.link], body.b),
        radius=body.radius,
    )  # fmt: skip
    return arm, description.q_ready


def _moved(T: Array, points: Array) -> Array:
    return np.einsum("cij,cj->ci", T[:, :3, :3], points) + T[:, :3, 3]


class _Fixed(NamedTuple):
    """What does not change from snapshot to snapshot."""

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
    """Write the joint velocities (n,) of a snapshot; return whether there are any."""
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
    return minimise_within(Program(H, f, lower, upper, rows.G, rows.h, rows.weight), 500, least) == SOLVED


class Rows:
    """Kinematics, closest points, rows, joint box and QP, and nothing else: the very problem, in one compiled call."""

    def __init__(self, problem: Problem) -> None:
        self.problem, model = problem, RobotModel(panda())
        arm, count = problem.arm, problem.points.shape[1]
        limits = JointLimits(arm.q_min, arm.q_max, arm.qd_max, arm.qdd_max, TERMS.period)
        cost = TaskParams(
            damping_max=TERMS.damping_max, manipulability_threshold=TERMS.manipulability_threshold,
            mid_joint_gain=TERMS.mid_joint_gain, mid_joint_time_s=TERMS.mid_joint_time,
        )  # fmt: skip
        approach = RestrictionParams(
            rows="hard", v_max_m_s=TERMS.v_max, beta=TERMS.beta, d_repulse_m=TERMS.d_repulse,
            d_crit_m=TERMS.d_crit, d_notice_m=TERMS.d_notice,
        )  # fmt: skip
        self.kin = model.kinematics(problem.q[0])
        self.fixed = _Fixed(
            model.hinges, model.moved_by, model.ee, model.body, limits.table, model.q_mid, cost.numbers,
            row_numbers(approach), np.arange(count),
        )  # fmt: skip

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p, x = self.problem, np.empty(len(self.fixed.q_mid))
        if not _solve(p.q[s], p.qd[s], p.points[s], p.velocity[s], self.fixed, self.kin, x):
            raise RuntimeError(f"The program of snapshot {s} has no answer.")
        return x


class Step:
    """A whole control step with as many sensor units, each of which shows a point; for K = 0 seven that show none.

    Beside the rows it examines the inputs, locates the points (eq. 1), leaves out views of the arm itself, tracks
    points and silent units, filters the force, detects contacts, chooses the mode, follows the path and records all of
    it. It is given the snapshot's arm; the points are others, where its own units look. Rows are soft.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.model = problem, RobotModel(panda())
        count = problem.points.shape[1]
        if count == 0:
            self._equip(paper_skin(self.model), np.full(7, np.nan), "approach.rows=slack")
            return
        drawn = 3 * count + 30
        units, distance = _units(self.model, drawn), np.random.default_rng(1).uniform(0.15, 0.5, drawn)
        # only units that never see the arm itself: so each shows a point in every snapshot
        shown = [k for first in range(0, drawn, _AT_ONCE) for k in self._shown(units, distance, first)][:count]
        self._equip(Skin([units[k] for k in shown], self.model), distance[shown], "approach.rows=slack")

    def _shown(self, units: list[SensorUnit], distance: Array, first: int) -> list[int]:
        """Return which of `_AT_ONCE` units from the first on show a point in all snapshots."""
        some = slice(first, first + _AT_ONCE)
        self._equip(Skin(units[some], self.model), distance[some], "approach=none")
        steps = (self.controller.step(self.state, self._inputs(self.time, s))[0] for s in range(len(self.problem.q)))
        return [first + k for k in sorted(set.intersection(*(set(step.obstacles.unit.tolist()) for step in steps)))]

    def _equip(self, skin: Skin, distance: Array, rows: str) -> None:
        """Put a skin on the arm with what its units read [m], NaN for no target, and run until the arm tracks."""
        paper = profile(f"paper:task.orientation=free:{rows}")
        x = self.model.kinematics(self.problem.q[0]).position[self.model.ee]
        self.controller = Controller(
            self.model, skin, no_fixtures(), segment(tuple(x), (x[0], x[1] + 0.4, x[2])), paper
        )
        self.distance = distance
        self.status = np.where(np.isnan(distance), int(RangeStatus.SIGNAL), int(RangeStatus.OK))
        self.state = self._armed()

    def _inputs(self, time: float, s: int) -> Inputs:
        q, qd = self.problem.q[s], self.problem.qd[s]
        robot = RobotState(time, q, qd, q, qd, np.zeros(len(q)), np.zeros(6))
        stamp = np.full(len(self.distance), time)
        return Inputs(time, robot, RangeReadings(stamp, self.distance, self.status))

    def _armed(self) -> ControllerState:
        """Return the state after the force window has filled, from where on the arm tracks."""
        state = self.controller.init(self._inputs(0.0, 0).robot)
        for cycle in range(self.controller.profile.window.samples + 10):
            _, state = self.controller.step(state, self._inputs(TERMS.period * cycle, 0))
        self.time = TERMS.period * (cycle + 1)
        return state

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one step from the armed state."""
        step, _ = self.controller.step(self.state, self._inputs(self.time, s))
        if step.mode.value != "track":
            raise RuntimeError(step.reason)
        return step.command


def _units(model: RobotModel, count: int) -> list[SensorUnit]:
    """Units all over the capsules that look outwards."""
    rng, body = np.random.default_rng(0), model.body
    units: list[SensorUnit] = []
    while len(units) < count:
        c = rng.integers(len(body.radius))
        z = rng.normal(size=3)
        axis = body.b[c] - body.a[c]
        z -= axis * (z @ axis) / (axis @ axis)
        z /= np.linalg.norm(z)
        p = body.a[c] + rng.uniform() * axis + (body.radius[c] + 0.002) * z
        own = body.link == body.link[c]
        if _height(p, body.a[own], body.b[own], body.radius[own]) > 0.001:
            T = np.eye(4)
            x = np.cross(axis, z) / np.linalg.norm(axis)
            T[:3, :3], T[:3, 3] = np.column_stack([x, np.cross(z, x), z]), p
            units.append(SensorUnit(f"unit {len(units)}", model.links[body.link[c]], T))
    return units


def _height(p: Array, a: Array, b: Array, radius: Array) -> float:
    """Distance of a point from the surface of the capsules [m]."""
    axis = b - a
    along = np.clip(np.einsum("ci,ci->c", p - a, axis) / np.einsum("ci,ci->c", axis, axis), 0.0, 1.0)
    return float((np.linalg.norm(p - a - along[:, None] * axis, axis=1) - radius).min())


CONTENDERS = {"ours, rows": Rows, "ours, whole step": Step}
