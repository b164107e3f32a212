"""mink: its configuration, posture task, solver loop; velocity task, joint box and approach rows are ours."""

from importlib.metadata import version

import mink
import mujoco
import numpy as np
from lab.peers import problem as posed
from lab.peers.problem import Array, Problem

VERSIONS = {name: version(name) for name in ("mink", "mujoco", "qpsolvers", "daqp", "numpy")}


class Velocity(mink.Task):
    """The TCP's velocity in the base frame; mink's FrameTask couples it to the orientation through a logarithm."""

    def __init__(self) -> None:
        super().__init__(cost=np.ones(3))
        self.jacobian, self.target = np.zeros((3, 0)), np.zeros(3)

    def compute_error(self, configuration: mink.Configuration) -> Array:
        """Displacement asked for, with mink's sign."""
        return -self.target * posed.PERIOD_S

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
        lower, upper = posed.joint_box(self.arm, configuration.q, self.qd)
        return mink.Constraint(G=self.G, h=np.concatenate([upper, -lower]) * dt)


class Approach(mink.Limit):
    """The approach rows, from MuJoCo's kinematics."""

    def __init__(self, problem: Problem, bodies: Array) -> None:
        self.arm, self.bodies, self.points = problem.arm, bodies, problem.points[0]

    def compute_qp_inequalities(self, configuration: mink.Configuration, dt: float) -> mink.Constraint:
        """Rows on the displacement."""
        data = configuration.data
        rotation, origin = data.xmat[self.bodies].reshape(-1, 3, 3), data.xpos[self.bodies]
        G, h = posed.approach_rows(self.arm, rotation, origin, self.points)
        return mink.Constraint(G=G, h=h * dt)


class Rows:
    """mink's solver loop on the very problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem, arm = problem, problem.arm
        self.model = mujoco.MjModel.from_xml_path(arm.mjcf)
        self.configuration = mink.Configuration(self.model)
        self.velocity, self.tcp = Velocity(), self.model.body("panda_hand_tcp").id
        posture = mink.PostureTask(
            self.model, cost=np.sqrt(posed.MID_JOINT_GAIN), gain=posed.PERIOD_S / posed.MID_JOINT_TIME_S
        )
        posture.set_target((arm.q_min + arm.q_max) / 2)
        self.tasks = [self.velocity, posture]
        self.box, self.approach = Box(problem), Approach(problem, self.model.jnt_bodyid.copy())
        self.limits = [self.box, self.approach] if problem.points.shape[1] else [self.box]

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p, jacobian = self.problem, np.empty((3, self.model.nv))
        self.approach.points = p.points[s]
        self.configuration.update(p.q[s])
        mujoco.mj_jacBody(self.model, self.configuration.data, jacobian, None, self.tcp)
        self.velocity.jacobian, self.velocity.target, self.box.qd = jacobian, p.velocity[s], p.qd[s]
        # a displacement's tolerance is period times a velocity's, so it must be set the finer
        how = {"damping": posed.damping(jacobian), "limits": self.limits, "primal_tol": 1e-9 * posed.PERIOD_S}
        return mink.solve_ik(self.configuration, self.tasks, posed.PERIOD_S, "daqp", **how)


CONTENDERS = {"mink, rows": Rows}
