"""pink: its configuration, posture task, solver loop; velocity task, joint box and approach rows are ours."""

from importlib.metadata import version

import numpy as np
import pink
import pinocchio as pin
from lab.peers import problem as posed
from lab.peers.problem import Array, Problem
from pink.limits import Limit
from pink.tasks import PostureTask, Task

VERSIONS = {name: version(name) for name in ("pin-pink", "pin", "qpsolvers", "daqp", "numpy")}


class Velocity(Task):
    """The TCP's velocity in the base frame; pink's FrameTask couples it to the orientation through a logarithm."""

    def __init__(self) -> None:
        super().__init__(cost=1.0)
        self.jacobian, self.target = np.zeros((3, 0)), np.zeros(3)

    def compute_error(self, configuration: pink.Configuration) -> Array:
        """Displacement asked for, with pink's sign."""
        return -self.target * posed.PERIOD_S

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
        lower, upper = posed.joint_box(self.arm, configuration.q, self.qd)
        return self.G, np.concatenate([upper, -lower]) * dt


class Approach(Limit):
    """The approach rows, from Pinocchio's kinematics."""

    def __init__(self, problem: Problem) -> None:
        self.arm, self.points = problem.arm, problem.points[0]

    def compute_qp_inequalities(self, configuration: pink.Configuration, dt: float) -> tuple[Array, Array]:
        """Rows on the displacement."""
        frames = configuration.data.oMi.tolist()[1:]
        rotation, origin = np.array([T.rotation for T in frames]), np.array([T.translation for T in frames])
        G, h = posed.approach_rows(self.arm, rotation, origin, self.points)
        return G, h * dt


class Rows:
    """pink's solver loop on the very problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem, arm, joint = problem, problem.arm, 0
        # joint by joint, so that both packages have the arm to the last digit
        self.model = model = pin.Model()
        for j, T in enumerate(arm.placement):
            joint = model.addJoint(joint, pin.JointModelRZ(), pin.SE3(T), f"joint{j + 1}")
        model.addFrame(pin.Frame("tcp", joint, 0, pin.SE3(arm.tool), pin.FrameType.OP_FRAME))
        model.lowerPositionLimit, model.upperPositionLimit, model.velocityLimit = arm.q_min, arm.q_max, arm.qd_max
        self.configuration = pink.Configuration(model, model.createData(), problem.q[0], copy_data=False)
        self.velocity, self.tcp = Velocity(), model.getFrameId("tcp")
        posture = PostureTask(cost=float(np.sqrt(posed.MID_JOINT_GAIN)), gain=posed.PERIOD_S / posed.MID_JOINT_TIME_S)
        posture.set_target((arm.q_min + arm.q_max) / 2)
        self.tasks = [self.velocity, posture]
        self.box, self.approach = Box(problem), Approach(problem)
        self.limits = [self.box, self.approach] if problem.points.shape[1] else [self.box]

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p, world = self.problem, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        self.approach.points = p.points[s]
        self.configuration.update(p.q[s])
        jacobian = pin.getFrameJacobian(self.model, self.configuration.data, self.tcp, world)[:3]
        self.velocity.jacobian, self.velocity.target, self.box.qd = jacobian, p.velocity[s], p.qd[s]
        # a displacement's tolerance is period times a velocity's, so it must be set the finer
        how = {"damping": posed.damping(jacobian), "limits": self.limits, "primal_tol": 1e-9 * posed.PERIOD_S}
        return pink.solve_ik(self.configuration, self.tasks, posed.PERIOD_S, "daqp", **how)


CONTENDERS = {"pink, rows": Rows}
