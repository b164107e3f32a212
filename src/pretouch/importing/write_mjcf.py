"""An arm as an MJCF file: joint frames, limits, inertials and capsules, and no meshes."""

from xml.etree import ElementTree as ET

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.importing.body import LinkBody
from pretouch.importing.capsule_fit import Rods
from pretouch.importing.chain import Arm
from pretouch.importing.limits import Limits
from pretouch.importing.source import WORLD, Inertial, SourceJoint
from pretouch.types import FloatArray


def mjcf_text(
    name: str, arm: Arm, limits: Limits, inertials: tuple[Inertial | None, ...], bodies: tuple[LinkBody, ...]
) -> str:
    """Return the MJCF of an arm. Its numbers are written to the last digit."""
    root = ET.Element("mujoco", model=name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(root, "option", timestep="0.001", integrator="implicitfast")
    elements = [ET.SubElement(root, "worldbody")]
    links, rods = arm.source.links, {body.link: body.rods for body in bodies}
    if links[0].name != WORLD:
        elements[0] = ET.SubElement(elements[0], "body", _pose(links[0].T_parent_link), name=links[0].name)
    for i, link in enumerate(links):
        if i:
            elements.append(ET.SubElement(elements[link.parent], "body", _pose(link.T_parent_link), name=link.name))
        if elements[i].tag == "body":
            _add_inertial(elements[i], inertials[i])
        for joint in link.joints:
            _add_joint(elements[i], joint, arm.joints.index(joint), limits)
        if i in rods:
            _add_capsules(elements[i], link.name, rods[i])
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def _add_inertial(body: ET.Element, own: Inertial | None) -> None:
    if own is None:
        ET.SubElement(body, "inertial", pos="0 0 0", mass="0", diaginertia="0 0 0")
        return
    values, axes = np.linalg.eigh(own.inertia)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    ET.SubElement(
        body, "inertial", pos=_text(own.com), quat=_quaternion(axes), mass=repr(own.mass), diaginertia=_text(values)
    )


def _add_joint(body: ET.Element, joint: SourceJoint, j: int, limits: Limits) -> None:
    torque = float(limits.tau_max[j])
    element = ET.SubElement(
        body, "joint", name=joint.name, type="hinge", axis=_text(joint.axis),
        range=_text(np.array([limits.q_min[j], limits.q_max[j]])), actuatorfrcrange=_text(np.array([-torque, torque])),
    )  # fmt: skip
    if joint.position.any():
        element.set("pos", _text(joint.position))
    if joint.reference:
        element.set("ref", repr(joint.reference))


def _add_capsules(body: ET.Element, link: str, rods: Rods) -> None:
    for k in range(len(rods)):
        along = rods.b[k] - rods.a[k]
        half = float(np.linalg.norm(along)) / 2
        turn, _ = Rotation.align_vectors(along[None] / (2 * half), np.array([[0.0, 0.0, 1.0]]))
        ET.SubElement(
            body, "geom", name=f"{link}_{k}", type="capsule", size=f"{float(rods.radius[k]):.7g} {half:.7g}",
            pos=" ".join(f"{x:.7g}" for x in (rods.a[k] + rods.b[k]) / 2), quat=_quaternion(turn.as_matrix()),
            contype="1", conaffinity="2", group="3", mass="0",
        )  # fmt: skip


def _pose(T: FloatArray) -> dict[str, str]:
    found = {}
    if T[:3, 3].any():
        found["pos"] = _text(T[:3, 3])
    if np.abs(T[:3, :3] - np.eye(3)).max() > 0:
        found["quat"] = _quaternion(T[:3, :3])
    return found


def _quaternion(R: FloatArray) -> str:
    return _text(Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True))


def _text(values: FloatArray) -> str:
    return " ".join(repr(float(v)) for v in values)
