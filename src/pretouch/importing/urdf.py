"""Reading of URDF files."""

from collections import defaultdict
from functools import partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.errors import RobotModelError
from pretouch.importing.meshes import MeshFinder
from pretouch.importing.solids import Block, Cylinder, MeshFile, Rounded, Shape
from pretouch.importing.source import Inertial, Source, SourceJoint, SourceLink
from pretouch.types import FloatArray

_LARGEST = 1e6
"""Largest number in a file: any larger one is a mistake."""


def required(element: Element | None, key: str) -> str:
    """Return an attribute; RobotModelError if it is missing."""
    value = element.get(key) if element is not None else None
    if element is None or value is None:
        tag = "element" if element is None else f"<{element.tag}>"
        raise RobotModelError(f"The URDF file has an {tag} without {key!r}: give it one.")
    return value


def number(element: Element, key: str, owner: str, default: float | None = None) -> float:
    """Return an attribute as a finite number; without a default it must be there."""
    text = element.get(key)
    if text is None and default is not None:
        return default
    return _finite(required(element, key), element, key, owner)


def vector(element: Element, key: str, count: int, owner: str, default: str | None = None) -> FloatArray:
    """Return an attribute as so many finite numbers."""
    text = element.get(key, default) if default is not None else required(element, key)
    words = (text or "").split()
    if len(words) != count:
        raise RobotModelError(f"{owner}: {key} of <{element.tag}> is {text!r}: give {count} numbers.")
    return np.array([_finite(word, element, key, owner) for word in words])


def origin_of(element: Element) -> FloatArray:
    """Return the pose (4, 4) in the element's <origin>; the identity if it has none."""
    T, origin = np.eye(4), element.find("origin")
    if origin is not None:
        owner = element.get("name") or f"<{element.tag}>"
        T[:3, 3] = vector(origin, "xyz", 3, owner, "0 0 0")
        T[:3, :3] = Rotation.from_euler("xyz", vector(origin, "rpy", 3, owner, "0 0 0")).as_matrix()
    return T


def inertia_of(element: Element, owner: str) -> FloatArray:
    """Return the symmetric matrix (3, 3) of an <inertia> [kg m^2]."""
    xx, xy, xz, yy, yz, zz = (number(element, f"i{key}", owner, 0.0) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _finite(text: str, element: Element, key: str, owner: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= _LARGEST:
        raise RobotModelError(f"{owner}: {key} of <{element.tag}> is {text[:50]!r}: give a finite number.")
    return value


_KINDS = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide", "fixed": "fixed"}
_OTHERS = ("planar", "floating")


def read_urdf(root: Element, file: Path, folders: tuple[Path, ...]) -> Source:
    """Read a robot from the root element of a URDF file. What is wrong is a RobotModelError.

    Meshes are found and read when they are needed.

    Args:
        root: the element <robot>.
        file: of it; relative mesh paths start there.
        folders: that hold ROS packages.
    """
    finder = MeshFinder(file, folders)
    links = {required(link, "name"): link for link in root.findall("link")}
    if len(links) < len(root.findall("link")):
        raise RobotModelError("Two links have the same name: give each its own.")
    joints = _joints(root, links)
    built = []
    for name, parent in _ordered(links, joints):
        element, joint = links[name], joints.get(name)
        T, moving = (np.eye(4), ()) if joint is None else (origin_of(joint), _moving(joint))
        link = SourceLink(
            name, parent, T, moving, _inertial(element), _shapes(element, "collision", finder),
            _shapes(element, "visual", finder),
        )  # fmt: skip
        built.append(link)
    return Source(root.get("name") or file.stem, tuple(built), _left_out(joints))


def _left_out(joints: dict[str, Element]) -> tuple[str, ...]:
    """Name the joints with damping or friction, which are not taken."""
    said = []
    for joint in joints.values():
        name, dynamics = required(joint, "name"), joint.find("dynamics")
        if dynamics is not None:
            damping, friction = (number(dynamics, key, name, 0.0) for key in ("damping", "friction"))
            said += [f"{name} ({damping:g} Nm s/rad, {friction:g} Nm)"] if damping or friction else []
    return (f"Damping and friction of the joints are left out: {', '.join(said)}.",) if said else ()


def _joints(root: Element, links: dict[str, Element]) -> dict[str, Element]:
    """Joints by the name of the link they move."""
    found: dict[str, Element] = {}
    for joint in root.findall("joint"):
        name = required(joint, "name")
        ends = []
        for end in ("parent", "child"):
            element = joint.find(end)
            link = element.get("link") if element is not None else None
            if link not in links:
                raise RobotModelError(
                    f"The joint {name} has the {end} {link!r}: choose from the links {', '.join(links)}."
                )
            ends.append(link)
        if ends[1] in found:
            raise RobotModelError(f"The link {ends[1]} is moved by two joints, one of them {name}: leave one out.")
        found[ends[1]] = joint
    return found


def _ordered(links: dict[str, Element], joints: dict[str, Element]) -> list[tuple[str, int]]:
    """Links with the indices of their parents, depth first from the only one that has none."""
    children: dict[str, list[str]] = defaultdict(list)
    for child, joint in joints.items():
        children[required(joint.find("parent"), "link")].append(child)
    roots = [name for name in links if name not in joints]
    if links and not roots:
        raise RobotModelError(f"The links {', '.join(links)} form a loop: leave one joint out.")
    if not links:
        raise RobotModelError("The robot has no links: give it some.")
    if len(roots) != 1:
        raise RobotModelError(f"The links have {len(roots)} roots ({', '.join(roots)}): connect them to one tree.")
    order: list[tuple[str, int]] = []
    waiting = [(roots[0], -1)]
    while waiting:
        name, parent = waiting.pop()
        order.append((name, parent))
        waiting += [(child, len(order) - 1) for child in reversed(children[name])]
    if len(order) < len(links):
        lost = sorted(set(links) - {name for name, _ in order})
        raise RobotModelError(f"The links {', '.join(lost)} form a loop: connect them to the root.")
    return order


def _moving(element: Element) -> tuple[SourceJoint, ...]:
    """Return the joint, unless it is fixed."""
    name, kind = required(element, "name"), element.get("type", "")
    if kind not in _KINDS and kind not in _OTHERS:
        raise RobotModelError(
            f"The joint {name} is of the type {kind!r}: choose from {', '.join([*_KINDS, *_OTHERS])}."
        )
    if kind == "fixed":
        return ()
    axis_element = element.find("axis")
    axis = np.array([1.0, 0.0, 0.0]) if axis_element is None else vector(axis_element, "xyz", 3, name)
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise RobotModelError(f"The joint {name} has an axis of length zero: give it a direction.")
    limit = element.find("limit")
    limits = None
    if limit is not None and kind in ("revolute", "prismatic"):
        limits = number(limit, "lower", name, 0.0), number(limit, "upper", name, 0.0)
    return (
        SourceJoint(
            name,
            {"hinge": "hinge", "slide": "slide"}.get(_KINDS.get(kind, ""), "other"),  # type: ignore[arg-type]
            axis / length,
            np.zeros(3),
            limits,
            None if limit is None else number(limit, "velocity", name, 0.0) or None,
            None if limit is None else number(limit, "effort", name, 0.0) or None,
            element.find("mimic") is not None,
        ),
    )


def _inertial(link: Element) -> Inertial | None:
    element = link.find("inertial")
    if element is None:
        return None
    name = required(link, "name")
    mass = element.find("mass")
    inertia = element.find("inertia")
    if mass is None or inertia is None:
        return None
    T = origin_of(element)
    I_axes = inertia_of(inertia, name)
    return Inertial(number(mass, "value", name), T[:3, 3], T[:3, :3] @ I_axes @ T[:3, :3].T)


def _shapes(link: Element, what: str, finder: MeshFinder) -> tuple[Shape, ...]:
    shapes = []
    for element in link.findall(what):
        geometry = element.find("geometry")
        solid = None if geometry is None else next(iter(geometry), None)
        if solid is not None:
            shapes.append(_shape(solid, required(link, "name"), origin_of(element), finder))
    return tuple(shapes)


def _shape(solid: Element, link: str, T: FloatArray, finder: MeshFinder) -> Shape:
    where = f"a shape of {link}"
    match solid.tag:
        case "box":
            x, y, z = (vector(solid, "size", 3, where) / 2).tolist()
            shape = Shape(Block((x, y, z)), T)
            sizes = [x, y, z]
        case "sphere":
            sizes = [number(solid, "radius", where)]
            shape = Shape(Rounded(sizes[0], 0.0), T)
        case "cylinder" | "capsule":
            sizes = [number(solid, "radius", where), number(solid, "length", where) / 2]
            shape = Shape((Cylinder if solid.tag == "cylinder" else Rounded)(*sizes), T)
        case "mesh":
            scale = vector(solid, "scale", 3, where) if solid.get("scale") else np.ones(3)
            sizes = np.abs(scale).tolist()
            x, y, z = scale.tolist()
            shape = Shape(MeshFile(partial(finder.find, required(solid, "filename")), (x, y, z)), T)
        case other:
            raise RobotModelError(f"The link {link} has a shape {other!r}: use box, sphere, cylinder, capsule or mesh.")
    if min(sizes) <= 0:
        raise RobotModelError(f"The link {link} has a {solid.tag} of size zero: give it positive dimensions.")
    return shape
