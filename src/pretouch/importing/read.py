"""Reading of a robot's URDF or MJCF file by MuJoCo, and of what MuJoCo does not take of a URDF."""

from functools import partial
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from trimesh import Trimesh

from pretouch.errors import RobotModelError
from pretouch.importing.meshes import MeshFinder, read_mesh
from pretouch.importing.tree import LARGEST, NO_MASS, SOLIDS, Beside, Robot, Shape, pose

_COMPILER = {
    "fusestatic": "false", "discardvisual": "false", "strippath": "false", "balanceinertia": "true",
    "inertiafromgeom": "false", "boundmass": str(NO_MASS), "boundinertia": str(NO_MASS),
}  # fmt: skip
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3}, "axis": {"xyz": 3}, "mass": {"value": 1}, "box": {"size": 3}, "mesh": {"scale": 3},
    "sphere": {"radius": 1}, "cylinder": {"radius": 1, "length": 1}, "capsule": {"radius": 1, "length": 1},
    "limit": {"lower": 1, "upper": 1, "velocity": 1, "effort": 1}, "dynamics": {"damping": 1, "friction": 1},
    "inertia": {f"i{axes}": 1 for axes in ("xx", "xy", "xz", "yy", "yz", "zz")},
}  # fmt: skip
"""How many numbers the attributes of a URDF's elements hold."""
_SHAPES = ("box", "sphere", "cylinder", "capsule", "mesh")
_TYPES = ("revolute", "continuous", "prismatic", "fixed", "planar")
_LARGEST_M = 5.0
"""Length of an origin beyond which it is taken for one in millimetres [m]."""
_NARROW = 0.1
"""Ranges of all joints below which they are taken for degrees, taken for radians, taken for degrees [rad]."""


def read_robot(file: Path, folders: tuple[Path, ...] = ()) -> Robot:
    """Read a robot from a URDF or MJCF file. What is wrong with it is a RobotModelError that names it.

    Meshes of a URDF are found and read when they are needed.

    Args:
        file: the file.
        folders: that hold the ROS packages a URDF names.
    """
    root = _root(file)
    if root.tag not in ("mujoco", "robot"):
        raise RobotModelError(
            f"The file {file} starts with <{root.tag}>: give a URDF (<robot>) or an MJCF (<mujoco>) file."
        )
    try:
        return _read_mjcf(file) if root.tag == "mujoco" else _read_urdf(root, file, MeshFinder(file, folders))
    except RobotModelError as error:
        raise RobotModelError(f"{error} (in {file})") from error
    except ValueError as error:
        raise RobotModelError(
            f"The file {file} cannot be read: {' '.join(str(error).split()).rstrip('.')}: correct it."
        ) from error


def _root(file: Path) -> ET.Element:
    try:
        data = file.read_bytes()
    except OSError as error:
        raise RobotModelError(f"The file {file} cannot be read: {error.strerror}: give a URDF or MJCF file.") from error
    template = f"Xacro is left in the file {file}: make a URDF of it by `xacro {file.name} -o expanded.urdf` first."
    try:
        root = ET.fromstring(data)  # noqa: S314  the user's own file
    except (ET.ParseError, ValueError, LookupError) as error:
        unbound = b"xacro:" in data and "unbound prefix" in str(error)
        raise RobotModelError(template if unbound else f"The file {file} is not valid XML: {error}.") from error
    for element in root.iter():
        if "xacro" in str(element.tag) or any("${" in value or "$(" in value for value in element.attrib.values()):
            raise RobotModelError(template)
    return root


def _read_mjcf(file: Path) -> Robot:
    spec, beside = mujoco.MjSpec.from_file(str(file)), Beside()
    if not spec.joints:
        raise RobotModelError("There is no robot in it, for no joint moves: is it a part of another file?")
    model = spec.compile()
    if model.neq:
        beside.remarks.append(f"{model.neq} equality constraints of the MJCF are left out.")
    moving = model.geom_bodyid > 0
    if ignored := int((moving & ~np.isin(model.geom_type, SOLIDS)).sum()):
        beside.remarks.append(f"{ignored} shapes that are planes, height fields or the like are left out.")
    if np.all(np.ptp(model.jnt_range, axis=1)[model.jnt_limited.astype(bool)] < _NARROW) and model.jnt_limited.any():
        beside.remarks.append(
            f"All joints have ranges below {_NARROW:g} rad: if they are radians in the file, its <compiler> needs"
            ' angle="radian".'
        )
    return Robot(spec.modelname or file.stem, model, _left_out(model, beside))


def _left_out(model: mujoco.MjModel, beside: Beside) -> Beside:
    values = model.dof_armature + model.dof_damping.reshape(model.nv, -1).sum(axis=1) + model.dof_frictionloss
    joints = {int(model.dof_jntid[dof]) for dof in np.flatnonzero(values)}
    joints |= {int(j) for j in np.flatnonzero(model.jnt_stiffness.reshape(model.njnt, -1).any(axis=1))}
    if joints:
        names = ", ".join(model.joint(j).name or f"joint{j + 1}" for j in sorted(joints))
        beside.remarks.append(f"Armature, damping, friction and springs of the joints are left out: {names}.")
    return beside


def _read_urdf(root: ET.Element, file: Path, finder: MeshFinder) -> Robot:
    beside, files = Beside(), list[str]()
    _check_numbers(root, beside)
    _check_tree(root)
    for other in root.findall("mujoco"):
        root.remove(other)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", _COMPILER)
    for link in root.findall("link"):
        _prepare_shapes(link, files)
        _prepare_inertial(link, beside)
    for joint in root.findall("joint"):
        _prepare_limit(joint, beside)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = spec.mesh(geom.meshname)
            read = partial(_mesh, finder, files[int(mesh.file)], mesh.scale.copy())
            shape = Shape(int(geom.type), np.zeros(3), pose(geom.pos, geom.quat), read)
            beside.meshes.setdefault(geom.parent.name, []).append((bool(geom.contype), shape))
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    model = spec.compile()
    return Robot(root.get("name") or file.stem, model, _left_out(model, beside))


def _mesh(finder: MeshFinder, uri: str, scale: np.ndarray) -> Trimesh:
    return read_mesh(finder.find(uri)).apply_scale(scale)


def _check_numbers(root: ET.Element, beside: Beside) -> None:
    """Refuse what is no number or no possible one; MuJoCo takes some of it, and names none."""
    turned = []
    for owner in [*root.findall("link"), *root.findall("joint")]:
        name = owner.get("name", f"<{owner.tag}>")
        for element in owner.iter():
            for key, count in _NUMBERS.get(str(element.tag), {}).items():
                text = element.get(key)
                if text is None:
                    continue
                try:
                    values = [float(word) for word in text.split()]
                except ValueError:
                    values = []
                wrong = f"{name}: {key} of <{element.tag}> is {text!r}: give"
                if len(values) != count or not all(abs(v) < LARGEST or element.tag == "limit" for v in values):
                    raise RobotModelError(f"{wrong} {count} finite number{'s' if count > 1 else ''}.")
                sizes = {"mesh": [abs(v) for v in values]}.get(str(element.tag), values)
                if element.tag in _SHAPES and min(sizes) <= 0:
                    raise RobotModelError(f"{wrong} a size that is not zero or negative.")
                if owner.tag == "joint" and key == "xyz" and max(map(abs, values)) > _LARGEST_M:
                    raise RobotModelError(f"{wrong} metres: these seem to be millimetres.")
                turned += [f"{name} ({text})"] if key == "rpy" and max(map(abs, values)) > 2 * np.pi + 0.01 else []
    if turned:
        beside.remarks.append(f"rpy beyond a turn, perhaps degrees in place of radians: {', '.join(turned)}.")


def _check_tree(root: ET.Element) -> None:
    """Refuse what is no tree, with names that MuJoCo leaves out."""
    links = [link.get("name", "") for link in root.findall("link")]
    joints = [joint.get("name", "") for joint in root.findall("joint")]
    for what, names in (("link", links), ("joint", joints)):
        for name in names:
            if not name or names.count(name) > 1:
                raise RobotModelError(f"The {what} name {name!r} is used more than once, or empty: give each its own.")
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        joint_name, kind = joint.get("name", ""), joint.get("type")
        if kind not in _TYPES:
            raise RobotModelError(f"The joint {joint_name} is of the type {kind!r}: choose from {', '.join(_TYPES)}.")
        ends = {key: element.get("link", "") for key in ("parent", "child") for element in joint.findall(key)[:1]}
        for key in ("parent", "child"):
            if (end := ends.get(key)) not in links:
                raise RobotModelError(f"The joint {joint_name} has the {key} {end!r}: choose from {', '.join(links)}.")
        child = ends["child"]
        if child in parents:
            raise RobotModelError(f"The link {child} is moved by two joints, one of them {joint_name}: leave one out.")
        parents[child] = ends["parent"]
    roots = [name for name in links if name not in parents]
    if not links:
        raise RobotModelError("The robot has no links: give it some.")
    if len(roots) > 1:
        raise RobotModelError(f"The links have {len(roots)} roots ({', '.join(roots)}): connect them to one tree.")
    tree = set(roots)
    while more := {child for child, parent in parents.items() if parent in tree} - tree:
        tree |= more
    if lost := sorted(set(links) - tree):
        raise RobotModelError(f"The links {', '.join(lost)} form a loop: leave one joint out.")


def _prepare_shapes(link: ET.Element, files: list[str]) -> None:
    """Keep shapes that are ones, the visual ones only where no other is; name each mesh by its place in `files`."""
    collision = link.find("collision/geometry/*") is not None
    for shape in [*link.findall("collision"), *link.findall("visual")]:
        solid = shape.find("geometry/*")
        if solid is None or (collision and shape.tag == "visual"):
            link.remove(shape)
            continue
        if solid.tag not in _SHAPES:
            name = link.get("name")
            raise RobotModelError(f"The link {name} has a shape {solid.tag!r}: use {', '.join(_SHAPES)}.")
        shape.attrib.clear()  # names may repeat
        for material in shape.findall("material"):
            shape.remove(material)
        if solid.tag == "mesh":
            files.append(solid.get("filename", ""))
            solid.set("filename", str(len(files) - 1))


def _prepare_inertial(link: ET.Element, beside: Beside) -> None:
    """Take out an inertial that MuJoCo refuses; keep its mass."""
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    value = 0.0 if mass is None else float(mass.get("value", 0.0))
    moments = np.array([0.0 if inertia is None else float(inertia.get(key, 0.0)) for key in _NUMBERS["inertia"]])
    matrix = moments[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]]
    if not value > 0 or np.linalg.eigvalsh(matrix)[0] <= 0:
        link.remove(inertial)
        beside.mass[link.get("name", "")] = value
    elif (values := np.linalg.eigvalsh(matrix))[2] > (1 + 1e-6) * (values[0] + values[1]):
        beside.remarks.append(
            f"The inertia of {link.get('name')} is impossible, a moment is larger than the sum of the other two: the"
            " mean of its moments is taken."
        )


def _prepare_limit(joint: ET.Element, beside: Beside) -> None:
    """Note what MuJoCo does not take of a joint's limits, and take out bounds that are none."""
    limit, name, kind = joint.find("limit"), joint.get("name", ""), joint.get("type")
    if limit is None:
        return
    low, high, speed = (float(limit.get(key, 0.0)) for key in ("lower", "upper", "velocity"))
    if 0 < abs(speed) < LARGEST:
        beside.velocity[name] = abs(speed)
    if kind == "continuous" and (low or high):
        beside.remarks.append(f"The position limits of {name} are not used: it is continuous.")
    elif not max(abs(low), abs(high)) < LARGEST or not low < high:
        if max(abs(low), abs(high)) < LARGEST and kind in ("revolute", "prismatic"):
            beside.ranges[name] = low, high
        for key in ("lower", "upper"):
            limit.attrib.pop(key, None)
