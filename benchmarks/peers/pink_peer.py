"""pink: its configuration, tasks and solver loop; obstacle rows as a limit of ours, or its own collision barrier."""

from importlib.metadata import version

import coal
import numpy as np
import pink
import pinocchio as pin
from benchmarks.peers.geometry import Array, approach_rows, damping, joint_box
from benchmarks.peers.problem import TERMS, Problem
from pink.barriers import SelfCollisionBarrier
from pink.limits import Limit
from pink.tasks import PostureTask, Task

VERSIONS = {name: version(name) for name in ("pin-pink", "pin", "coal", "qpsolvers", "daqp", "numpy")}
POINT_RADIUS = 0.001
"""Radius of the spheres that stand for points in its own collision barrier [m]."""


class Velocity(Task):
    """The TCP's velocity in the base frame; pink's FrameTask couples it to the orientation through a logarithm."""

    def __init__(self) -> None:
        super().__init__(cost=1.0)
        self.jacobian, self.target = np.zeros((3, 0)), np.zeros(3)

    def compute_error(self, configuration: pink.Configuration) -> Array:
        """Displacement asked for, with pink's sign."""
        return -self.target * TERMS.period

    def compute_jacobian(self, configuration: pink.Configuration) -> Array:
        """Pinocchio's Jacobian, which the damping has needed before."""
        return self.jacobian

    def __repr__(self) -> str:
        return "Velocity()"


class Box(Limit):
    """Position, velocity and acceleration limits."""

    def __init__(self, problem: Problem) -> None:
        n = problem.q.shape[1]
        self.arm, self.qd, self.G = problem.arm, np.zeros(n), np.concatenate([np.eye(n), -np.eye(n)])

    def compute_qp_inequalities(self, configuration: pink.Configuration, dt: float) -> tuple[Array, Array]:
        """Bounds on the displacement."""
        lower, upper = joint_box(self.arm, configuration.q, self.qd, dt)
        return self.G, np.concatenate([upper, -lower]) * dt


class Approach(Limit):
    """The approach rows, from Pinocchio's kinematics."""

    def __init__(self, problem: Problem) -> None:
        self.arm, self.points = problem.arm, problem.points[0]

    def compute_qp_inequalities(self, configuration: pink.Configuration, dt: float) -> tuple[Array, Array]:
        """Rows on the displacement."""
        frames = configuration.data.oMi.tolist()[1:]
        rotation, origin = np.array([T.rotation for T in frames]), np.array([T.translation for T in frames])
        G, h = approach_rows(self.arm, rotation, origin, self.points, TERMS)
        return G, h * dt


def model_of(problem: Problem) -> pin.Model:
    """Build the arm joint by joint, so that both packages have it to the last digit."""
    arm, model = problem.arm, pin.Model()
    joint = 0
    for j, T in enumerate(arm.placement):
        joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3(T), f"joint{j + 1}")
    model.addFrame(pin.Frame("tcp", joint, 0, pin.SE3(arm.tool), pin.FrameType.OP_FRAME))
    model.lowerPositionLimit, model.upperPositionLimit = arm.q_min, arm.q_max
    model.velocityLimit = arm.qd_max
    return model


class Rows:
    """pink's solver loop on the very problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem, arm = problem, problem.arm
        self.count = problem.points.shape[1]
        self.model = model_of(problem)
        self.velocity, self.tcp = Velocity(), self.model.getFrameId("tcp")
        posture = PostureTask(cost=float(np.sqrt(TERMS.mid_joint_gain)), gain=TERMS.period / TERMS.mid_joint_time)
        posture.set_target((arm.q_min + arm.q_max) / 2)
        self.tasks = [self.velocity, posture]
        self.box = Box(problem)
        self.limits: list[Limit] = [self.box]
        self.barriers: list[SelfCollisionBarrier] = []
        self.configuration = self._configuration()

    def _configuration(self) -> pink.Configuration:
        if self.count:
            self.approach = Approach(self.problem)
            self.limits.append(self.approach)
        return pink.Configuration(self.model, self.model.createData(), self.problem.q[0], copy_data=False)

    def _place(self, points: Array) -> None:
        self.approach.points = points

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p = self.problem
        if self.count:
            self._place(p.points[s])
        self.configuration.update(p.q[s])
        world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        jacobian = pin.getFrameJacobian(self.model, self.configuration.data, self.tcp, world)[:3]
        self.velocity.jacobian, self.velocity.target, self.box.qd = jacobian, p.velocity[s], p.qd[s]
        mu = damping(jacobian, TERMS)
        # a displacement's tolerance is period times a velocity's, so it must be set the finer
        return pink.solve_ik(
            self.configuration, self.tasks, TERMS.period, "daqp", damping=mu, limits=self.limits,
            barriers=self.barriers, primal_tol=1e-9 * TERMS.period,
        )  # fmt: skip


class Native(Rows):
    """The same task and joint box with pink's own barrier on the K closest of all pairs of capsule and point."""

    def _configuration(self) -> pink.Configuration:
        geometry, arm = pin.GeometryModel(), self.problem.arm
        capsules = []
        for c in range(len(arm.radius)):
            axis = arm.b[c] - arm.a[c]
            R = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix()
            place = pin.SE3(R, (arm.a[c] + arm.b[c]) / 2)
            shape = coal.Capsule(float(arm.radius[c]), float(np.linalg.norm(axis)))
            joint = int(arm.joint[c]) + 1
            capsules.append(geometry.addGeometryObject(pin.GeometryObject(f"capsule{c}", joint, place, shape)))
        for k in range(self.count):
            sphere = pin.GeometryObject(f"point{k}", 0, pin.SE3.Identity(), coal.Sphere(POINT_RADIUS))
            point = geometry.addGeometryObject(sphere)
            for capsule in capsules:
                geometry.addCollisionPair(pin.CollisionPair(capsule, point))
        self.spheres = list(geometry.geometryObjects)[len(capsules) :]
        if self.count:
            # without its displacement towards a safe posture the cost stays that of the problem
            self.barriers.append(SelfCollisionBarrier(self.count, gain=1.0, safe_displacement_gain=0.0, d_min=0.02))
        return pink.Configuration(
            self.model, self.model.createData(), self.problem.q[0], copy_data=False, collision_model=geometry
        )

    def _place(self, points: Array) -> None:
        for sphere, point in zip(self.spheres, points, strict=True):
            sphere.placement.translation = point


CONTENDERS = {"pink, rows": Rows, "pink, native": Native}
