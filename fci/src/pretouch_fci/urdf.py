"""The arm as a URDF, for the client that has no model library of its own: links, joints, masses, limits."""

import math
from functools import cache
from xml.etree.ElementTree import Element, SubElement, tostring

import mujoco
import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray
from pretouch_fci.frames import Inertial, flange_of, inertials


@cache
def urdf_of(model: RobotModel) -> str:
    """Return the URDF of an arm up to its flange. Hand and load are not in it: a client has them from the state."""
    d, flange = model.description, flange_of(model)
    mj = mujoco.MjModel.from_xml_path(str(d.mjcf))
    bodies = inertials(model)
    robot = Element("robot", name=d.name)
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
    moments = {
        f"i{'xyz'[i]}{'xyz'[j]}": repr(float(body.inertia[i, j])) for i in range(3) for j in range(i, 3)
    }  # fmt: skip
    SubElement(inertial, "inertia", moments)


def _add_joint(robot: Element, model: RobotModel, mj: mujoco.MjModel, link: int, number: int) -> None:
    """Add the joint between a link and the one before it."""
    moves = int(mj.body_jntnum[link]) > 0
    joint = SubElement(robot, "joint", name=f"joint{number}", type="revolute" if moves else "fixed")
    SubElement(joint, "parent", link=f"link{number - 1}")
    SubElement(joint, "child", link=f"link{number}")
    SubElement(joint, "origin", xyz=_text(mj.body_pos[link]), rpy=_text(_rpy(mj.body_quat[link])))
    if not moves:
        return
    j, d = int(mj.body_jntadr[link]), model.description
    SubElement(joint, "axis", xyz=_text(mj.jnt_axis[j]))
    low, high = float(model.q_min[j]), float(model.q_max[j])
    if d.envelope is not None:
        low, high = float(d.envelope.q_lower[j]), float(d.envelope.q_upper[j])
    SubElement(
        joint, "limit", lower=repr(low), upper=repr(high), velocity=repr(float(d.qd_max[j])),
        effort=repr(float(d.tau_max[j])),
    )  # fmt: skip
    if d.envelope is not None:
        SubElement(
            joint, "position_based_velocity_limits", velocity_offset=repr(float(d.envelope.offset[j])),
            deceleration_limit=repr(float(d.envelope.slope[j] / 2)),
        )  # fmt: skip


def _rpy(quat: FloatArray) -> FloatArray:
    """Angles (3,) [rad] about fixed x, y, z of a quaternion (4,)."""
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quat)
    R = matrix.reshape(3, 3)
    pitch = math.atan2(-R[2, 0], math.hypot(R[0, 0], R[1, 0]))
    return np.array([math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])])


def _text(numbers: FloatArray) -> str:
    return " ".join(repr(float(x)) for x in numbers)
