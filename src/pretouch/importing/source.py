"""A robot as its file describes it: a tree of links with joints, inertials and shapes, before anything is chosen."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from pretouch.errors import RobotModelError
from pretouch.importing.solids import Shape
from pretouch.types import FloatArray

WORLD = "world"
"""Name of MuJoCo's own frame. A file's first link of this name stands for it."""


@dataclass(frozen=True, eq=False)
class SourceJoint:
    """A joint that moves a link, and those beyond it, against its parent."""

    name: str
    kind: Literal["hinge", "slide", "other"]
    axis: FloatArray
    """(3,) unit vector, link frame."""
    position: FloatArray
    """(3,) a point of the axis, link frame [m]."""
    limits: tuple[float, float] | None = None
    """Lowest and highest position [rad]; None if the file has none."""
    velocity: float | None = None
    """Limit [rad/s], if the file has one."""
    effort: float | None = None
    """Limit [Nm], if the file has one."""
    coupled: bool = False
    """Whether another joint leads it (URDF: mimic)."""
    reference: float = 0.0
    """Its position where the link is as `T_parent_link` says [rad, m]."""


@dataclass(frozen=True, eq=False)
class Inertial:
    """Mass and inertia of a link."""

    mass: float
    """[kg]"""
    com: FloatArray
    """(3,) centre of mass, link frame [m]."""
    inertia: FloatArray
    """(3, 3) about the centre of mass, in the axes of the link's frame [kg m^2]."""


@dataclass(frozen=True, eq=False)
class SourceLink:
    """One link."""

    name: str
    parent: int
    """Index of its parent; -1 of the first link."""
    T_parent_link: FloatArray
    """(4, 4) with all of its joints at their references."""
    joints: tuple[SourceJoint, ...] = ()
    inertial: Inertial | None = None
    collision: tuple[Shape, ...] = ()
    visual: tuple[Shape, ...] = ()


@dataclass(frozen=True, eq=False)
class Source:
    """A robot: its links, each after its parent, the descendants of one link without a gap."""

    name: str
    links: tuple[SourceLink, ...]
    remarks: tuple[str, ...] = field(default=())
    """What in the file is left out or taken otherwise, a sentence each."""

    def __post_init__(self) -> None:
        _check_names("link", [link.name for link in self.links])
        _check_names("joint", [joint.name for link in self.links for joint in link.joints])
        if any(link.name == WORLD for link in self.links[1:]):
            raise RobotModelError(f"A link is called {WORLD!r}, like MuJoCo's own frame: rename it.")

    def index(self, name: str) -> int:
        """Return the index of a link; an unknown name is a RobotModelError that lists those there are."""
        names = [link.name for link in self.links]
        if name not in names:
            raise RobotModelError(f"The link {name!r} is unknown: choose from {', '.join(names)}.")
        return names.index(name)

    def ancestors(self, link: int) -> list[int]:
        """Return the links from the first one to this one, itself included."""
        way = []
        while link >= 0:
            way.append(link)
            link = self.links[link].parent
        return way[::-1]

    def poses(self, q: dict[str, float]) -> FloatArray:
        """Poses of all links (L, 4, 4) in the frame of the first, at positions of joints by name; others at rest."""
        found = np.zeros((len(self.links), 4, 4))
        for i, link in enumerate(self.links):
            pose = np.eye(4) if link.parent < 0 else found[link.parent]
            found[i] = pose @ link.T_parent_link
            for joint in link.joints:
                found[i] = found[i] @ moved(joint, q.get(joint.name, joint.reference))
        return found


def moved(joint: SourceJoint, position: float) -> FloatArray:
    """Return what a joint at a position [rad, m] does to its link, (4, 4)."""
    T, by = np.eye(4), position - joint.reference
    if joint.kind == "slide":
        T[:3, 3] = by * joint.axis
        return T
    T[:3, :3] = Rotation.from_rotvec(by * joint.axis).as_matrix()
    T[:3, 3] = joint.position - T[:3, :3] @ joint.position
    return T


def locked(link: SourceLink, joint: SourceJoint) -> SourceLink:
    """Return a link one of whose joints is fixed where it is zero, or as near to that as it comes."""
    low, high = joint.limits or (-np.inf, np.inf)
    place = link.joints.index(joint)
    T = link.T_parent_link
    if joint.kind != "other":
        T = T @ moved(joint, min(max(0.0, low), high))
    return replace(link, T_parent_link=T, joints=link.joints[:place] + link.joints[place + 1 :])


def _check_names(what: str, names: list[str]) -> None:
    """Refuse names that nothing could be told apart by."""
    for name in names:
        if not name or not name.isprintable() or len(name) > 200:
            raise RobotModelError(f"A {what} is called {name[:200]!r}: give it a printable name, at most 200 letters.")
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RobotModelError(f"The {what} name {twice[0]!r} is used more than once: give each its own.")
