"""mink: its configuration, tasks, solver loop; obstacle rows as a limit of ours, or its own collision avoidance."""

from importlib.metadata import version

import mink
import mujoco
import numpy as np
from benchmarks.peers.geometry import Array, approach_rows, damping, joint_box
from benchmarks.peers.problem import TERMS, Problem

VERSIONS = {name: version(name) for name in ("mink", "mujoco", "qpsolvers", "daqp", "numpy")}
POINT_RADIUS = 0.001
"""Radius of the spheres that stand for points in its own collision avoidance [m]."""


class Velocity(mink.Task):
    """The TCP's velocity in the base frame; mink's FrameTask couples it to the orientation through a logarithm."""

    def __init__(self) -> None:
        super().__init__(cost=np.ones(3))
        self.jacobian, self.target = np.zeros((3, 0)), np.zeros(3)

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """Displacement asked for, with mink's sign."""
        return -self.target * TERMS.period

    def compute_jacobian(self, configuration: mink.Configuration) -> Array:
        """MuJoCo's Jacobian, which the damping has needed before."""
        return self.jacobian


class Box(mink.Limit):
    """Position, velocity and acceleration limits."""

    def __init__(self, problem: Problem) -> None:
        n = problem.q.shape[1]
        self.arm, self.qd, self.G = problem.arm, np.zeros(n), np.concatenate([np.eye(n), -np.eye(n)])

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Bounds on the displacement."""
        lower, upper = joint_box(self.arm, configuration.q, self.qd, dt)
        return mink.Constraint(G=self.G, h=np.concatenate([upper, -lower]) * dt)


class Approach(mink.Limit):
    """The approach rows, from MuJoCo's kinematics."""

    def __init__(self, problem: Problem, bodies: Array) -> None:
        self.arm, self.bodies, self.points = problem.arm, bodies, problem.points[0]

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Rows on the displacement."""
        data = configuration.data
        rotation, origin = data.xmat[self.bodies].reshape(-1, 3, 3), data.xpos[self.bodies]
        G, h = approach_rows(self.arm, rotation, origin, self.points, TERMS)
        return mink.Constraint(G=G, h=h * dt)


class Rows:
    """mink's solver loop on the very problem."""

    native = False

    def __init__(self, problem: Problem) -> None:
        self.problem, arm = problem, problem.arm
        spec = mujoco.MjSpec.from_file(arm.mjcf)
        if self.native:
            for k in range(problem.points.shape[1]):
                body = spec.worldbody.add_body(name=f"point{k}", mocap=True)
                body.add_geom(name=f"point{k}", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[POINT_RADIUS, 0, 0],
                              contype=3, conaffinity=3)  # fmt: skip
        self.model = spec.compile()
        self.configuration = mink.Configuration(self.model)
        self.velocity, self.tcp = Velocity(), self.model.body("panda_hand_tcp").id
        posture = mink.PostureTask(
            self.model, cost=np.sqrt(TERMS.mid_joint_gain), gain=TERMS.period / TERMS.mid_joint_time
        )
        posture.set_target((arm.q_min + arm.q_max) / 2)
        self.tasks = [self.velocity, posture]
        self.box = Box(problem)
        self.limits: list[mink.Limit] = [self.box]
        if problem.points.shape[1]:
            self.limits.append(self._avoidance())

    def _avoidance(self) -> mink.Limit:
        self.approach = Approach(self.problem, self.model.jnt_bodyid.copy())
        return self.approach

    def _place(self, points: Array) -> None:
        self.approach.points = points

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p = self.problem
        if p.points.shape[1]:
            self._place(p.points[s])
        self.configuration.update(p.q[s])
        jacobian = np.empty((3, self.model.nv))
        mujoco.mj_jacBody(self.model, self.configuration.data, jacobian, None, self.tcp)
        self.velocity.jacobian, self.velocity.target, self.box.qd = jacobian, p.velocity[s], p.qd[s]
        mu = damping(jacobian, TERMS)
        # a displacement's tolerance is period times a velocity's, so it must be set the finer
        return mink.solve_ik(
            self.configuration, self.tasks, TERMS.period, "daqp", damping=mu, limits=self.limits,
            primal_tol=1e-9 * TERMS.period,
        )  # fmt: skip


class Native(Rows):
    """The same task and joint box with mink's own collision avoidance: every capsule against every point."""

    native = True

    def _avoidance(self) -> mink.Limit:
        geoms = [self.model.geom(g) for g in range(self.model.ngeom)]
        moved = [g.name for g in geoms if self.model.body_weldid[g.bodyid[0]] and not g.name.startswith("point")]
        points = [g.name for g in geoms if g.name.startswith("point")]
        return mink.CollisionAvoidanceLimit(
            self.model, [(moved, points)], minimum_distance_from_collisions=0.02,
            collision_detection_distance=TERMS.d_notice,
        )  # fmt: skip

    def _place(self, points: Array) -> None:
        self.configuration.data.mocap_pos[:] = points


CONTENDERS = {"mink, rows": Rows, "mink, native": Native}
