"""Kinematics and dynamics of an arm that MuJoCo reads."""

import mujoco
import numpy as np

from pretouch.errors import RobotModelError
from pretouch.robot.body import Capsules, Surface, bodies_of, capsules_of, surface_of
from pretouch.robot.description import RobotDescription
from pretouch.robot.kinematics import (
    G_M_S2,
    ArmTopology,
    Hinges,
    Kinematics,
    Links,
    Mechanism,
    jacobian_into,
    mass_matrix_into,
    place,
    tangents_of,
)
from pretouch.types import BoolArray, FloatArray, IntArray


class RobotModel:
    """Poses, Jacobians of any body point, mass matrix, Coriolis and gravity torques of an arm.

    Rotor inertia and damping of the MJCF are left out: the joint torque sensors are on the link side. All results
    depend on the arguments alone. `kinematics`, Jacobians and `mass_matrix`, the methods that a controller calls, are
    safe in any thread. `mass_matrix_and_bias` works in MuJoCo's memory, the `scratch`: one thread at a time may call
    it.
    """

    def __init__(self, description: RobotDescription) -> None:
        self.description = description
        try:
            self._model = mujoco.MjModel.from_xml_path(str(description.mjcf))
        except ValueError as error:
            raise RobotModelError(
                f"{description.name}: {description.mjcf} cannot be read: {' '.join(str(error).split())}"
            ) from error
        self._model.dof_armature[:] = 0.0
        self._model.dof_damping[:] = 0.0
        up, across = 0.0 - description.gravity / np.linalg.norm(description.gravity), np.empty((2, 3))
        tangents_of(up, across)
        upright = np.array([0.0 - across[1], across[0], up])
        self.gravity: FloatArray = 0.0 - G_M_S2 * up
        """(3,) acceleration by gravity, base frame [m/s^2]."""
        self._model.opt.gravity[:] = self.gravity
        self._data = mujoco.MjData(self._model)
        self.scratch = self._model, self._data
        """MuJoCo's model and data, for compiled code that calls MuJoCo as the methods here do."""
        self.n: int = self._model.nv
        self._check()
        self.links: tuple[str, ...] = tuple(self._model.body(i).name for i in range(self._model.nbody))
        """Names of the links; a link's index is its place here, 0 is the world."""
        self.joints: tuple[str, ...] = tuple(self._model.joint(j).name for j in range(self.n))
        """Names of the joints, in the order of q."""
        self.ee: int = self._end_effector()
        """Index of the end-effector's link."""
        self.capsules: Capsules = capsules_of(self._model)
        """The body, base included."""
        self.hinges = _hinges(self._model)
        """Tree of the links, for compiled code."""
        self.moved_by: BoolArray = self._moved_by()
        """(L, n) whether a joint moves a link."""
        self.body: Capsules = self.capsules.of_links(np.flatnonzero(self.moved_by.any(axis=1)))
        """The part of the body that any joint moves."""
        if not len(self.body.link):
            raise RobotModelError(f"{description.name}: no joint moves a capsule: give the links capsule geoms.")
        moved = self.moved_by[self.capsules.link]
        self.apart: IntArray = np.argwhere(np.triu((moved[:, None] != moved[None]).sum(axis=2) >= 2))
        """(P, 2) pairs of capsules with two joints or more between them, by their index; see `robot.postures`."""
        self.parts: IntArray = np.unique(self.body.link)
        """(P,) links of the body."""
        centers = (self.body.a + self.body.b) / 2
        middle = np.array([centers[self.body.link == part].mean(axis=0) for part in self.parts])
        mass, com = self._model.body_mass.copy(), self._model.body_ipos.copy()
        self.mechanism = Mechanism(
            ArmTopology(self.moved_by, self.ee), Links(mass, com, self._inertia(), self.parts, middle), upright
        )
        """Its links, for compiled code."""
        rest = self.kinematics(np.zeros(self.n))
        self.surface: Surface = surface_of(self.body, self.moved_by, rest)
        """Points on the surface of the arm, where it may be touched."""
        self.rigid: IntArray = bodies_of(self.moved_by)
        """(L,) the rigid body each link belongs to, from 0; -1 of links that no joint moves."""
        self.q_min: FloatArray = self._model.jnt_range[:, 0].copy()
        self.q_max: FloatArray = self._model.jnt_range[:, 1].copy()
        self.q_mid: FloatArray = (self.q_min + self.q_max) / 2

    def _check(self) -> None:
        """Refuse models that the package does not support."""
        name = self.description.name
        if self.n != len(self.description.q_ready):
            raise RobotModelError(f"{name}: the MJCF has {self.n} joints, q_ready {len(self.description.q_ready)}.")
        for j in range(self._model.njnt):
            joint = self._model.joint(j).name
            if self._model.jnt_type[j] != mujoco.mjtJoint.mjJNT_HINGE:
                raise RobotModelError(f"{name}: joint {joint} is not a hinge: only hinge joints are supported.")
            if not self._model.jnt_limited[j]:
                raise RobotModelError(f"{name}: joint {joint} has no range: give it its position limits.")

    def _end_effector(self) -> int:
        try:
            return self.link_index(self.description.ee_body)
        except RobotModelError as error:
            raise RobotModelError(f"{self.description.name}: ee_body: {error}") from error

    def _moved_by(self) -> BoolArray:
        moved = np.zeros((self._model.nbody, self.n), dtype=np.bool_)
        for body in range(1, self._model.nbody):
            moved[body] = moved[self._model.body_parentid[body]]
            start, count = self._model.body_jntadr[body], self._model.body_jntnum[body]
            moved[body, start : start + count] = True
        return moved

    def _inertia(self) -> FloatArray:
        principal, turned = np.empty((self._model.nbody, 3, 3)), np.empty(9)
        for body in range(self._model.nbody):
            mujoco.mju_quat2Mat(turned, self._model.body_iquat[body])
            R = turned.reshape(3, 3)
            principal[body] = R @ np.diag(self._model.body_inertia[body]) @ R.T
        return principal

    def link_index(self, name: str) -> int:
        """Return the index of a link; an unknown name is a RobotModelError that lists the links."""
        try:
            return self.links.index(name)
        except ValueError:
            links = ", ".join(self.links[1:])
            raise RobotModelError(f"The link {name!r} is unknown: choose from {links}.") from None

    def kinematics(self, q: FloatArray) -> Kinematics:
        """Compute poses and joint axes at joint positions q (n,) [rad]."""
        angles = np.ascontiguousarray(q, np.float64)
        links, n = len(self.links), self.n
        if angles.shape != (n,):  # compiled code reads on behind the end
            raise ValueError(f"Joint positions have the shape {angles.shape}: give {self.n} of them.")
        kin = Kinematics(np.empty((links, 3)), np.empty((links, 3, 3)), np.empty((n, 3)), np.empty((n, 3)))
        place(self.hinges, angles, kin)
        return kin

    def jacobian(self, kin: Kinematics, link: int, point: FloatArray) -> FloatArray:
        """Jacobian (6, n) of a point (3,) [m, base frame] fixed to a link: velocity first, then angular velocity."""
        jacobian = np.empty((6, self.n))
        jacobian_into(kin.anchor, kin.axis, self.moved_by[link], point, jacobian)
        return jacobian

    def ee_jacobian(self, kin: Kinematics) -> FloatArray:
        """Jacobian (6, n) of the end-effector origin."""
        return self.jacobian(kin, self.ee, kin.position[self.ee])

    def mass_matrix(self, q: FloatArray) -> FloatArray:
        """Compute the mass matrix (n, n) [kg m^2] at q (n,) [rad]."""
        mass_matrix = np.empty((self.n, self.n))
        mass_matrix_into(self.kinematics(q), self.mechanism, mass_matrix)
        return mass_matrix

    def mass_matrix_and_bias(self, q: FloatArray, qd: FloatArray, bias: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute the mass matrix (n, n) and, into `bias` (n,), Coriolis plus gravity torques [Nm]."""
        model, data = self._model, self._data
        data.qpos[:], data.qvel[:] = q, qd
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_crb(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_rne(model, data, 0, bias)
        mass_matrix = np.zeros((self.n, self.n))
        mujoco.mj_fullM(model, data, mass_matrix)
        return mass_matrix, bias


def _hinges(model: mujoco.MjModel) -> Hinges:
    """Return the tree of the links of a model whose joints are all hinges."""
    T, R = np.empty((model.nbody, 3, 4)), np.empty(9)
    for link in range(model.nbody):
        mujoco.mju_quat2Mat(R, model.body_quat[link])
        T[link, :, :3], T[link, :, 3] = R.reshape(3, 3), model.body_pos[link]
    first = np.append(0, np.cumsum(model.body_jntnum))  # joints are in the order of their links
    joint = np.column_stack([model.jnt_pos, model.jnt_axis, model.qpos0])
    return Hinges(model.body_parentid.astype(np.int64), first.astype(np.int64), T, joint)
