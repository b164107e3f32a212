"""Reading of a robot's URDF or MJCF file by MuJoCo, of what MuJoCo does not take of a URDF, and of mesh files."""

import warnings
from contextlib import suppress
from functools import partial
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from trimesh import Trimesh, load_scene

from pretouch.errors import RobotModelError
from pretouch.extras import MESHES
from pretouch.importing.tree import LARGEST, NO_MASS, SOLIDS, Beside, RobotTree, Shape, pose
from pretouch.types import FloatArray

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
_MESHES = (".stl", ".obj", ".dae")


def read_robot(file: Path, folders: tuple[Path, ...] = ()) -> RobotTree:
    """Read a robot from a URDF or MJCF file. A fault of the file is a RobotModelError that names it.

    Meshes of a URDF are read when they are needed. `folders` hold the ROS packages that it names, or are packages.
    """
    if odd := [folder for folder in folders if not folder.is_dir()]:
        raise RobotModelError(f"The package path {odd[0]} is not a folder: give one that holds ROS packages.")
    root, beside = _root(file), Beside()
    if root.tag not in ("mujoco", "robot"):
        raise RobotModelError(
            f"The file {file} starts with <{root.tag}>: give a URDF (<robot>) or an MJCF (<mujoco>) file."
        )
    try:
        spec = _urdf(root, beside, file, folders) if root.tag == "robot" else mujoco.MjSpec.from_file(str(file))
        if not spec.joints:
            raise RobotModelError("There is no robot in it, for no joint moves: is it a part of another file?")
        model = spec.compile()
    except RobotModelError as error:
        raise RobotModelError(f"{error} (in {file})") from error
    except ValueError as error:
        reason = " ".join(str(error).split()).rstrip(".")
        raise RobotModelError(f"The file {file} cannot be read: {reason}: correct it.") from error
    name = spec.modelname if root.tag == "mujoco" else root.get("name")
    _note_left_out(model, beside.remarks)
    return RobotTree(name or file.stem, model, beside)


def _root(file: Path) -> ET.Element:
    template = f"Xacro is left in the file {file}: make a URDF of it by `xacro {file.name} -o expanded.urdf` first."
    try:
        root = ET.fromstring(file.read_bytes())  # noqa: S314  the user's own file
    except OSError as error:
        raise RobotModelError(f"The file {file} cannot be read: {error.strerror}: give a URDF or MJCF file.") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        undefined = "unbound prefix" in str(error)
        raise RobotModelError(template if undefined else f"The file {file} is not valid XML: {error}.") from error
    for element in root.iter():
        if "xacro" in str(element.tag) or any("${" in value or "$(" in value for value in element.attrib.values()):
            raise RobotModelError(template)
    return root


def _note_left_out(model: mujoco.MjModel, remarks: list[str]) -> None:
    """Say what an arm will be without."""
    if model.neq:
        remarks.append(f"{model.neq} couplings, of joints that mimic others or of bodies, are left out.")
    if others := int((~np.isin(model.geom_type, SOLIDS) & (model.geom_bodyid > 0)).sum()):
        remarks.append(f"{others} shapes that are planes, height fields or the like are left out.")


def _urdf(root: ET.Element, beside: Beside, file: Path, folders: tuple[Path, ...]) -> mujoco.MjSpec:
    """Return a URDF without its meshes: these stand in `beside`, as does what MuJoCo does not take of it."""
    uris = list[str]()
    for other in root.findall("mujoco"):
        root.remove(other)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", _COMPILER)
    for link in root.findall("link"):
        _prepare_shapes(link, uris)
        _prepare_inertial(link, beside)
    for joint in root.findall("joint"):
        _prepare_joint(joint, beside)
    _check_finite(root)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    for geom in list(spec.geoms):
        if geom.type == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = spec.mesh(geom.meshname)
            read = partial(_scaled_mesh, uris[int(mesh.file)], mesh.scale.copy(), file, folders)
            shape = Shape(int(geom.type), np.zeros(3), pose(geom.pos, geom.quat), read)
            beside.meshes.setdefault(geom.parent.name, []).append((bool(geom.contype), shape))
            spec.delete(geom)
    for mesh in list(spec.meshes):
        spec.delete(mesh)
    return spec


def _scaled_mesh(uri: str, scale: FloatArray, file: Path, folders: tuple[Path, ...]) -> Trimesh:
    return read_mesh(_find_mesh(uri, file, folders)).apply_scale(scale)


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
    principal = np.linalg.eigvalsh(moments[[[0, 1, 2], [1, 3, 4], [2, 4, 5]]])
    if not value > 0 or principal[0] <= 0:
        link.remove(inertial)
        beside.mass[link.get("name", "")] = value
    elif principal[2] > (1 + 1e-6) * (principal[0] + principal[1]):
        beside.remarks.append(
            f"The inertia of {link.get('name')} is impossible, a moment is larger than the sum of the other two: the"
            " mean of its moments is taken."
        )


def _prepare_joint(joint: ET.Element, beside: Beside) -> None:
    """Note what MuJoCo does not take of a joint, take out bounds that are none, and look for other units."""
    origin, limit, name = joint.find("origin"), joint.find("limit"), joint.get("name", "")
    if origin is not None:
        xyz = origin.get("xyz", "0 0 0")
        if max(abs(float(word)) for word in xyz.split()) > _LARGEST_M:
            raise RobotModelError(f"{name}: xyz of <origin> is {xyz!r}: give metres; these seem to be millimetres.")
    if limit is None:
        return
    low, high, speed = (float(limit.get(key, 0.0)) for key in ("lower", "upper", "velocity"))
    if 0 < abs(speed) < LARGEST:
        beside.velocity[name] = abs(speed)
    if joint.get("type") == "continuous" and (low or high):
        beside.remarks.append(f"The position limits of {name} are not used: it is continuous.")
    endless = joint.get("type") == "continuous" or not max(abs(low), abs(high)) < LARGEST
    if endless or not low < high:
        if not endless:
            beside.ranges[name] = low, high
        for key in ("lower", "upper"):
            limit.attrib.pop(key, None)


def _check_finite(root: ET.Element) -> None:
    """Refuse what MuJoCo takes for a number and is none."""
    for owner in [*root.findall("link"), *root.findall("joint")]:
        for element in owner.iter():
            for key, text in element.attrib.items():
                if element.tag != "limit" and {"nan", "inf", "-inf"}.intersection(text.lower().split()):
                    name = owner.get("name")
                    raise RobotModelError(f"{name}: {key} of <{element.tag}> is {text!r}: give finite numbers.")


def _find_mesh(uri: str, file: Path, folders: tuple[Path, ...]) -> Path:
    """Return the mesh file that a URDF names: relative to it, by absolute path, or in a ROS package.

    The package `p` of package://p/rest is looked for as the folder `p` in `folders`, or one of them, then in the folder
    of the URDF and in each above it. A mesh that is not found is a RobotModelError.
    """
    scheme, _, name = unquote(uri).replace("\\", "/").rpartition("://")
    near = file.resolve().parent
    places = [near / (name.removeprefix("localhost") if scheme == "file" else name)]
    way_out = f"put it at {places[0]}, where the URDF says"
    if scheme in ("package", "model"):
        package, _, rest = name.partition("/")
        around = [*folders, near, *near.parents]
        places = [folder / name for folder in around] + [folder / rest for folder in around if folder.name == package]
        way_out = f"give --package-path the folder that holds the package {package}"
    for place in places:
        with suppress(OSError, ValueError):  # a name may be too long, or none
            if place.is_file():
                return place
    raise RobotModelError(f"The mesh {uri} was not found: {way_out}.")


def read_mesh(path: Path) -> Trimesh:
    """Read a mesh file, as its suffix says, in metres. What is wrong with it is a RobotModelError that names it.

    Nothing but the file itself is read: no materials or textures beside it.
    """
    suffix = path.suffix.lower()
    if suffix not in _MESHES:
        raise RobotModelError(f"The mesh {path} has an unknown format: use {', '.join(_MESHES)}.")
    if suffix == ".dae":
        MESHES.need(f"The mesh {path}, a COLLADA file,")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", "string or file could not be read")  # NumPy would leave the rest out
            data = path.read_bytes()
            if suffix == ".obj":
                _check_obj(data)
            scene = load_scene(BytesIO(data), suffix[1:], process=False)
            mesh = (scene.convert_units("meters") if scene.units else scene).to_mesh()
    except Exception as error:  # whatever a library makes of a broken file
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise RobotModelError(f"The mesh {path} is damaged: {reason}.") from error
    if not len(mesh.faces) or not np.isfinite(mesh.triangles).all() or not np.any(mesh.triangles_cross):
        raise RobotModelError(
            f"The mesh {path} holds no triangle with an area and finite corners, or is truncated: give a complete file."
        )
    return mesh


def _check_obj(data: bytes) -> None:
    """Refuse corners counted backwards or from 0: trimesh 5.2 takes them for other ones."""
    faces = (line.split()[1:] for line in data.splitlines() if line.startswith(b"f "))
    if any(int(corner.split(b"/")[0]) < 1 for face in faces for corner in face):
        raise ValueError("its faces do not count their corners from 1 onwards: save it anew by another program")
