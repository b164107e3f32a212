"""Reading of a robot's URDF or MJCF file by MuJoCo, of what MuJoCo does not take of a URDF, and of mesh files."""

import re
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.meshes import MeshFiles
from pretouch.importing.tree import NO_MASS, SOLIDS, Beside, RobotTree, Shape, pose

_COMPILER = {
    "fusestatic": "false",
    "discardvisual": "false",
    "strippath": "false",
    "balanceinertia": "true",
    "inertiafromgeom": "false",
    "boundmass": str(NO_MASS),
    "boundinertia": str(NO_MASS),
}
_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_LARGEST_M = 5.0
"""Length of an origin beyond which it is taken for one in millimetres [m]."""
_LARGEST_RAD = 6.3
"""Angle of an origin beyond which it is taken for one in degrees [rad]."""


def read_robot(file: Path, folders: tuple[Path, ...] = (), arguments: tuple[str, ...] = ()) -> RobotTree:
    """Read a robot from a URDF, xacro or MJCF file. A fault of the file is a RobotModelError that names it.

    Meshes of a URDF are read when they are needed. `folders` hold the ROS packages that it names, or are packages.
    `arguments` of a xacro file are texts such as prefix:=left_.
    """
    if odd := [folder for folder in folders if not folder.is_dir()]:
        raise RobotModelError(f"The package path {odd[0]} is not a folder: give one that holds ROS packages.")
    beside = Beside()
    root = _root(file, folders, arguments, beside.remarks)
    if root.tag not in ("mujoco", "robot"):
        raise RobotModelError(
            f"The file {file} starts with <{root.tag}>: give a URDF (<robot>) or an MJCF (<mujoco>) file."
        )
    try:
        spec = _urdf(root, beside, file, folders) if root.tag == "robot" else mujoco.MjSpec.from_file(str(file))
        if not spec.joints:
            raise RobotModelError("There is no robot in it, for no joint moves: is it a part of another file?")
        model = spec.compile()
        _check_bodies(spec, model)
    except RobotModelError as error:
        raise RobotModelError(f"{error} (in {file})") from error
    except ValueError as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise RobotModelError(f"The file {file} cannot be read: {reason}: correct it.") from error
    name = spec.modelname if root.tag == "mujoco" else root.get("name")
    if model.neq:
        beside.remarks.append(f"{model.neq} couplings, of joints that mimic others or of bodies, are left out.")
    if others := int((~np.isin(model.geom_type, SOLIDS) & (model.geom_bodyid > 0)).sum()):
        beside.remarks.append(f"{others} shapes that are planes, height fields or the like are left out.")
    return RobotTree(name or file.stem, model, beside)


def _root(file: Path, folders: tuple[Path, ...], arguments: tuple[str, ...], remarks: list[str]) -> ET.Element:
    """Return the root of a file, expanded if it is a xacro template."""
    template = False
    try:
        data = file.read_bytes()
        template = b"xacro:" in data  # where its prefix is not defined, it is no valid XML
        root = ET.fromstring(data)  # noqa: S314  the user's own file
        template = _has_xacro(root)
        if not template:
            return root
        root = ET.fromstring(_expanded(data, file, folders, arguments))  # noqa: S314
        if not _has_xacro(root):
            remarks.append("The xacro in the file was expanded.")
            return root
    except RobotModelError:
        raise
    except OSError as error:
        raise RobotModelError(f"The file {file} cannot be read: {error.strerror}: give a URDF or MJCF file.") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        if not (template and "unbound prefix" in str(error)):
            raise RobotModelError(f"The file {file} is not valid XML: {error}.") from error
    raise RobotModelError(
        f"Xacro is left in the file {file}: install xacrodoc by `pip install xacrodoc`, or make a URDF of it by"
        f" `xacro {file.name} -o expanded.urdf` where ROS is."
    )


def _has_xacro(root: ET.Element) -> bool:
    """Return whether an element or a value of xacro is anywhere in a file."""
    words = (str(word) for element in root.iter() for word in (element.tag, *element.attrib, *element.attrib.values()))
    return any("${" in word or "$(" in word or "xacro}" in word for word in words)


def _expanded(data: bytes, file: Path, folders: tuple[Path, ...], arguments: tuple[str, ...]) -> bytes | str:
    """Return what xacrodoc or xacro makes of a template; without both, the template."""
    try:
        values = dict(argument.split(":=", 1) for argument in arguments)
        if find_spec("xacrodoc"):
            xacrodoc: Any = import_module("xacrodoc")
            xacrodoc.packages.reset()
            xacrodoc.packages.look_in([str(folder) for folder in folders])
            return str(xacrodoc.XacroDoc.from_file(file, resolve_packages=False, subargs=values).to_urdf_string())
        if find_spec("xacro"):
            return str(import_module("xacro").process_file(str(file), mappings=values).toxml())
    except Exception as error:  # whatever a library makes of a template
        reason = " ".join(str(error).split())
        raise RobotModelError(
            f"The xacro in {file} cannot be expanded: {reason}: give its arguments by --xacro NAME:=VALUE, and the"
            " folders of its packages by --package-path."
        ) from error
    return data


def _check_bodies(spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
    """Refuse lengths and angles of bodies that must be of another unit."""
    far = (np.abs(np.hstack([model.body_pos, model.body_ipos])).max(axis=1) > _LARGEST_M) & (model.body_parentid > 0)
    if far.any():
        name = model.body(int(far.argmax())).name
        raise RobotModelError(f"{name} is more than {_LARGEST_M:g} m from its parent: give metres, not millimetres.")
    for body in spec.bodies:
        turn, quarters = np.abs(body.alt.euler), np.round(np.abs(body.alt.euler) / (np.pi / 2))
        radians = quarters.any() and turn.max() < _LARGEST_RAD and np.allclose(turn, quarters * np.pi / 2, atol=2e-3)
        if radians if spec.compiler.degree else turn.max() > _LARGEST_RAD:
            unit, other = ("degrees", "radians") if spec.compiler.degree else ("radians", "degrees")
            raise RobotModelError(
                f"{body.name}: euler is {body.alt.euler.tolist()} {unit}: these seem to be {other}, which <compiler"
                " angle=...> has to say."
            )


def _urdf(root: ET.Element, beside: Beside, file: Path, folders: tuple[Path, ...]) -> mujoco.MjSpec:
    """Return a URDF without its meshes: these stand in `beside`, as does what MuJoCo does not take of it."""
    uris, files = list[str](), MeshFiles(file, folders, beside.remarks)
    for other in root.findall("mujoco"):
        root.remove(other)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", _COMPILER)
    for link in root.findall("link"):
        _prepare_shapes(link, uris)
        _prepare_inertial(link, beside)
    for joint in root.findall("joint"):
        _prepare_joint(joint, beside)
    _check_numbers(root)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = spec.mesh(geom.meshname)
            read = partial(files.read, uris[int(mesh.file)], mesh.scale.copy())
            shape = Shape(int(geom.type), np.zeros(3), pose(geom.pos, geom.quat), read)
            beside.meshes.setdefault(geom.parent.name, []).append((bool(geom.contype), shape))
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec


def _prepare_shapes(link: ET.Element, uris: list[str]) -> None:
    """Keep the visual shapes only where no other is; name each mesh by its place in `uris`."""
    collision = link.find("collision/geometry/*") is not None
    for shape in [*link.findall("collision"), *link.findall("visual")]:
        solid = shape.find("geometry/*")
        if solid is None or (collision and shape.tag == "visual"):
            link.remove(shape)
            continue
        shape.attrib.clear()  # names may repeat
        for material in shape.findall("material"):
            shape.remove(material)
        if solid.tag == "mesh":
            uris.append(solid.get("filename", ""))
            solid.set("filename", str(len(uris) - 1))


def _prepare_inertial(link: ET.Element, beside: Beside) -> None:
    """Take out an inertial that MuJoCo refuses; keep its mass."""
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    value = 0.0 if mass is None else float(mass.get("value", 0.0))
    moments = np.array([0.0 if inertia is None else float(inertia.get(key, 0.0)) for key in _INERTIA])
    principal = np.linalg.eigvalsh(np.nan_to_num(moments)[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
    if not value > 0 or not np.isfinite(moments).all() or principal[0] <= 0:
        link.remove(inertial)
        beside.mass[link.get("name", "")] = value
    elif principal[2] > (1 + 1e-6) * (principal[0] + principal[1]):
        beside.remarks.append(
            f"The inertia of {link.get('name')} is impossible, a moment is larger than the sum of the other two: the"
            " mean of its moments is taken."
        )


def _prepare_joint(joint: ET.Element, beside: Beside) -> None:
    """Note the limits of a joint, and take out those of its position: MuJoCo refuses some that mean none."""
    limit, name = joint.find("limit"), joint.get("name", "")
    if limit is None:
        return
    low, high, speed = (float(limit.get(key, 0.0)) for key in ("lower", "upper", "velocity"))
    beside.velocity[name] = abs(speed)
    if joint.get("type") != "continuous":
        beside.ranges[name] = low, high
    elif low or high:
        beside.remarks.append(f"The position limits of {name} are not used: it is continuous.")
    for key in ("lower", "upper"):
        limit.attrib.pop(key, None)


def _check_numbers(root: ET.Element) -> None:
    """Refuse what MuJoCo takes for a number and is none, and origins that must be of another unit."""
    for owner in [*root.findall("link"), *root.findall("joint")]:
        for element in owner.iter():
            for key, text in element.attrib.items():
                words, fault = text.lower().split(), ""
                if element.tag != "limit" and {"nan", "inf", "-inf"}.intersection(words):
                    fault = "give finite numbers"
                elif key in ("xyz", "rpy", "value", "size") and re.search(r"\d,\d", text):
                    fault = "give decimal points, and spaces between numbers"
                elif (
                    key == "xyz"
                    and element.tag == "origin"
                    and max(map(abs, map(float, words)), default=0) > _LARGEST_M
                ):
                    fault = "give metres; these seem to be millimetres"
                elif key == "rpy" and max(map(abs, map(float, words)), default=0) > _LARGEST_RAD:
                    fault = "give radians, less than a turn; these seem to be degrees"
                if fault:
                    raise RobotModelError(f"{owner.get('name')}: {key} of <{element.tag}> is {text!r}: {fault}.")
