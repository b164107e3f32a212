"""NEO (Haviland and Corke 2021) as the Robotics Toolbox writes it: a QP over joint velocities and task slack.

NEO is no function of the toolbox but its published example; this is that example's problem with our terms. Its rows are
either ours, from the toolbox's kinematics, or those of its own `link_collision_damper`.
"""

from importlib.metadata import version

import numpy as np
import qpsolvers
import roboticstoolbox as rtb
import spatialgeometry as sg
from benchmarks.peers.geometry import Array, approach_rows, damping, joint_box
from benchmarks.peers.problem import TERMS, Problem
from spatialmath import SE3

VERSIONS = {
    name: version(name) for name in ("roboticstoolbox-python", "spatialgeometry", "coal", "qpsolvers", "daqp", "numpy")
}
POINT_RADIUS = 0.001
"""Radius of the spheres that stand for points in its own collision damper [m]."""
_SLACK = 10.0
"""Bound of the task slack, as in NEO's example [m/s]."""


class Rows:
    """NEO's form of the very problem: with the slack v - J qd put in, its cost is that of the problem."""

    def __init__(self, problem: Problem) -> None:
        self.problem, arm = problem, problem.arm
        self.links, last = [], None
        for j, T in enumerate(arm.placement):
            last = rtb.Link(rtb.ET.SE3(SE3(T, check=False)) * rtb.ET.Rz(), name=f"link{j + 1}", parent=last)
            self.links.append(last)
            last.collision = self._collision(j)
        tcp = rtb.Link(rtb.ET.SE3(SE3(arm.tool, check=False)), name="tcp", parent=last)
        self.robot = rtb.Robot([*self.links, tcp], name="panda")
        self.n = len(self.links)
        self.q_mid = (arm.q_min + arm.q_max) / 2

    def _collision(self, joint: int) -> list[sg.Shape]:
        return []

    def _obstacle_rows(self, s: int) -> tuple[Array | None, Array | None]:
        p = self.problem
        if not p.points.shape[1]:
            return None, None
        # base, seven links, TCP
        frames = self.robot.fkine_all(p.q[s]).A[1:-1]
        frames = np.array(frames)
        return approach_rows(p.arm, frames[:, :3, :3], frames[:, :3, 3], p.points[s], TERMS)

    def solve(self, s: int) -> Array:
        """Joint velocities (n,) [rad/s] of one snapshot."""
        p, n = self.problem, self.n
        q = p.q[s]
        J = self.robot.jacob0(q)[:3]
        Q = np.eye(n + 3)
        Q[:n, :n] *= damping(J, TERMS) + TERMS.mid_joint_gain
        c = np.zeros(n + 3)
        c[:n] = -TERMS.mid_joint_gain * (self.q_mid - q) / TERMS.mid_joint_time
        lower, upper = joint_box(p.arm, q, p.qd[s], TERMS.period)
        slack = np.full(3, _SLACK)
        G, h = self._obstacle_rows(s)
        if G is not None:
            G = np.c_[G, np.zeros((len(G), 3))]
        qd = qpsolvers.solve_qp(
            Q, c, G, h, np.c_[J, np.eye(3)], p.velocity[s], np.r_[lower, -slack], np.r_[upper, slack],
            solver="daqp", primal_tol=1e-9,
        )  # fmt: skip
        if qd is None:
            raise RuntimeError("the QP has no solution")
        return qd[:n]


class Native(Rows):
    """The same task and joint box with NEO's own collision dampers, a call a point.

    The toolbox has no capsules: each is a cylinder of its radius and full length.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.spheres = [sg.Sphere(POINT_RADIUS) for _ in range(problem.points.shape[1])]

    def _collision(self, joint: int) -> list[sg.Shape]:
        arm, shapes = self.problem.arm, []
        for c in np.flatnonzero(arm.joint == joint):
            axis = arm.b[c] - arm.a[c]
            length = float(np.linalg.norm(axis))
            z = axis / length
            x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
            x /= np.linalg.norm(x)
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = np.column_stack([x, np.cross(z, x), z]), (arm.a[c] + arm.b[c]) / 2
            shapes.append(sg.Cylinder(arm.radius[c], length + 2 * arm.radius[c], pose=SE3(T, check=False)))
        return shapes

    def _obstacle_rows(self, s: int) -> tuple[Array | None, Array | None]:
        q = self.problem.q[s]
        self.robot.q = q
        self.robot._update_link_tf(q)
        self.robot.update()
        G, h = [], []
        for sphere, point in zip(self.spheres, self.problem.points[s], strict=True):
            T = np.eye(4)
            T[:3, 3] = point
            sphere.T = T
            A, b = self.robot.link_collision_damper(
                sphere, q, TERMS.d_notice, 0.02, 1.0, start=self.links[0], end=self.links[-1]
            )
            if A is not None:
                G.append(A)
                h.append(b)
        return (np.concatenate(G), np.concatenate(h)) if G else (None, None)


CONTENDERS = {"NEO, rows": Rows, "NEO, native": Native}
