"""Frames and loads at the flange, as the robot's interface lets set them, masses of the arm's links, and its URDF."""

from dataclasses import dataclass, field
from functools import cache
from xml.etree.ElementTree import Element, SubElement, tostring

import mujoco
import numpy as np
import scipy  # its parts load when they are first used: a quarter of a second that a help does not wait

from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

_ROTATION_SLACK = 1e-3


@dataclass(frozen=True, slots=True)
class Inertial:
    """A rigid body's mass, in a frame that its owner names."""

    mass: float
    """[kg]"""
    com: FloatArray
    """(3,) centre of mass [m]."""
    inertia: FloatArray
    """(3, 3) about the centre of mass [kg m^2]."""


def pose(kin: Kinematics, link: int) -> FloatArray:
    """Pose T_O_link (4, 4) of a link."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = kin.rotation[link], kin.position[link]
    return T


def pose_of(columns: FloatArray) -> FloatArray | None:
    """Read a pose (4, 4) from the sixteen numbers of a request, column by column; None if it is none."""
    T = np.array(columns).reshape(4, 4).T
    if not np.all(np.isfinite(T)) or np.any(T[3] != (0.0, 0.0, 0.0, 1.0)):
        return None
    R = T[:3, :3]
    proper = np.allclose(R @ R.T, np.eye(3), atol=_ROTATION_SLACK) and np.linalg.det(R) > 0
    return T if proper else None


def flange_of(model: RobotModel) -> int:
    """Index of the flange: the last link before the hand, which carries the end-effector."""
    name = next((name for name in model.links if name.endswith("link8")), None)
    return model.ee if name is None else model.link_index(name)


@dataclass
class Frames:
    """Poses of end-effector and stiffness frame on the flange, and the load of the flange."""

    flange: int
    """Index of the flange's link."""
    F_T_NE: FloatArray
    """(4, 4) nominal end-effector on the flange."""
    hand: Inertial
    """End-effector, in the flange's frame."""
    NE_T_EE: FloatArray = field(default_factory=lambda: np.eye(4))
    """(4, 4) end-effector on the nominal one."""
    EE_T_K: FloatArray = field(default_factory=lambda: np.eye(4))
    """(4, 4) stiffness frame, in which the external wrench acts, on the end-effector."""
    load: Inertial = field(default_factory=lambda: Inertial(0.0, np.zeros(3), np.zeros((3, 3))))
    """Load of the hand that the client has set, in the flange's frame."""

    @property
    def F_T_EE(self) -> FloatArray:
        """(4, 4) end-effector on the flange."""
        return self.F_T_NE @ self.NE_T_EE


def frames_of(model: RobotModel) -> Frames:
    """Return the frames of an arm as delivered: the end-effector is the model's."""
    kin, flange = model.kinematics(model.description.q_ready), flange_of(model)
    return Frames(flange, np.linalg.inv(pose(kin, flange)) @ pose(kin, model.ee), hand_of(model, flange))


@cache
def _as_described(model: RobotModel) -> mujoco.MjModel:
    """Return MuJoCo's model as it was before any load was announced."""
    return mujoco.MjModel.from_xml_path(str(model.description.mjcf))


def inertials(model: RobotModel) -> list[Inertial]:
    """Return the inertial of each link of the model, in the link's frame."""
    mj, bodies = _as_described(model), []
    for body in range(mj.nbody):
        R = np.zeros((3, 3))
        mujoco.mju_quat2Mat(R.reshape(-1), mj.body_iquat[body])
        inertia = R @ np.diag(mj.body_inertia[body]) @ R.T
        bodies.append(Inertial(float(mj.body_mass[body]), mj.body_ipos[body].copy(), inertia))
    return bodies


def hand_of(model: RobotModel, flange: int) -> Inertial:
    """Return what the flange's link carries, as one body in the flange's frame."""
    kin = model.kinematics(model.description.q_ready)
    R, origin = kin.rotation[flange], kin.position[flange]
    parts = [
        moved(inertial, R.T @ kin.rotation[link], R.T @ (kin.position[link] - origin))
        for link, inertial in enumerate(inertials(model))
        if link > flange and inertial.mass > 0
    ]
    return combined(parts)


def announce(model: RobotModel, flange: int, own: Inertial, load: Inertial) -> None:
    """Have a model that is one arm's alone count a load at the flange, beside the flange's own mass.

    Both are in the flange's frame.
    """
    both = combined([own, load])
    moments, axes = np.linalg.eigh(both.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    mj, data = model.scratch
    mj.body_mass[flange], mj.body_ipos[flange], mj.body_inertia[flange] = both.mass, both.com, moments
    mujoco.mju_mat2Quat(mj.body_iquat[flange], axes.reshape(-1))
    mujoco.mj_setConst(mj, data)


def combined(parts: list[Inertial]) -> Inertial:
    """Return several bodies in one frame as one."""
    mass = sum(part.mass for part in parts)
    if not mass:
        return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    com = np.asarray(sum((part.mass * part.com for part in parts), np.zeros(3)) / mass)
    inertia = np.zeros((3, 3))
    for part in parts:
        r = part.com - com
        inertia += part.inertia + part.mass * (r @ r * np.eye(3) - np.outer(r, r))
    return Inertial(mass, com, inertia)


def moved(inertial: Inertial, R: FloatArray, p: FloatArray) -> Inertial:
    """Return a body in another frame, in which its own one is turned by R (3, 3) and at p (3,) [m]."""
    return Inertial(inertial.mass, R @ inertial.com + p, R @ inertial.inertia @ R.T)


@cache
def urdf_of(model: RobotModel) -> str:
    """Return the URDF of an arm up to its flange. Hand and load are not in it: a client has them from the state."""
    flange, mj, bodies = flange_of(model), _as_described(model), inertials(model)
    robot = Element("robot", name=model.description.name)
    base = 1
    for link in range(base, flange + 1):
        element = SubElement(robot, "link", name=f"link{link - base}")
        if bodies[link].mass > 0:
            _add_inertial(element, bodies[link])
        if link > base:
            _add_joint(robot, model, mj, link, link - base)
    return tostring(robot, encoding="unicode")


def _add_inertial(link: Element, body: Inertial) -> None:
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_text(body.com), rpy="0 0 0")
    SubElement(inertial, "mass", value=repr(body.mass))
    moments = {f"i{'xyz'[i]}{'xyz'[j]}": repr(float(body.inertia[i, j])) for i in range(3) for j in range(i, 3)}
    SubElement(inertial, "inertia", moments)


def _add_joint(robot: Element, model: RobotModel, mj: mujoco.MjModel, link: int, number: int) -> None:
    """Add the joint between a link and the one before it."""
    moves = int(mj.body_jntnum[link]) > 0
    joint = SubElement(robot, "joint", name=f"joint{number}", type="revolute" if moves else "fixed")
    SubElement(joint, "parent", link=f"link{number - 1}")
    SubElement(joint, "child", link=f"link{number}")
    rotation = scipy.spatial.transform.Rotation.from_quat(mj.body_quat[link], scalar_first=True)
    SubElement(joint, "origin", xyz=_text(mj.body_pos[link]), rpy=_text(rotation.as_euler("xyz")))  # about fixed axes
    if not moves:
        return
    j, d = int(mj.body_jntadr[link]), model.description
    SubElement(joint, "axis", xyz=_text(mj.jnt_axis[j]))
    low, high = float(model.q_min[j]), float(model.q_max[j])
    if d.envelope is not None:
        low, high = float(d.envelope.q_lower[j]), float(d.envelope.q_upper[j])
    SubElement(joint, "limit", _attributes(lower=low, upper=high, velocity=d.qd_max[j], effort=d.tau_max[j]))
    if d.envelope is not None:
        limits = _attributes(velocity_offset=d.envelope.offset[j], deceleration_limit=d.envelope.slope[j] / 2)
        SubElement(joint, "position_based_velocity_limits", limits)


def _attributes(**numbers: float) -> dict[str, str]:
    return {name: repr(float(number)) for name, number in numbers.items()}


def _text(numbers: FloatArray) -> str:
    return " ".join(repr(float(x)) for x in numbers)
