"""A robot as its file describes it: a tree of links with joints and shapes, over MuJoCo's model."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import mujoco
import numpy as np
from trimesh import Trimesh, creation
from trimesh.util import append_faces

from pretouch.errors import RobotModelError
from pretouch.types import FloatArray

_KINDS = {int(mujoco.mjtJoint.mjJNT_HINGE): "hinge", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide"}
_LARGEST = 1e6
"""From here on a limit stands for none."""
NO_MASS = 1e-12
"""Mass and inertia in the model of a link without mass [kg, kg m^2]: MuJoCo moves no link without."""
_TURN = 48
"""Corners of a circle: its polygon is less than 0.3 % of the radius off."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A solid on a link."""

    kind: int
    """One of MuJoCo's kinds of geoms."""
    size: FloatArray
    """(3,) as MuJoCo has it: half lengths and radii [m]."""
    T: FloatArray
    """(4, 4) link frame."""
    mesh: Callable[[], Trimesh] | None = None
    """Reads its triangles, if it is a mesh."""

    def triangles(self) -> Trimesh:
        """Return the triangles of its surface, link frame; what is wrong with a mesh is a RobotModelError."""
        x, y, _ = (float(v) for v in self.size)
        kinds = mujoco.mjtGeom
        # round solids are made of radius 1 [m], since trimesh leaves out triangles below a fixed area
        if self.mesh is not None:
            solid = self.mesh()
        elif self.kind == kinds.mjGEOM_BOX:
            solid = creation.box(2 * self.size)
        elif self.kind == kinds.mjGEOM_CYLINDER:
            solid = creation.cylinder(1.0, 2 * y / x, _TURN).apply_scale(x)
        elif self.kind == kinds.mjGEOM_ELLIPSOID:
            solid = creation.uv_sphere(1.0, (_TURN // 2, _TURN // 2)).apply_scale(self.size)
        else:
            length = 2 * y / x if self.kind == kinds.mjGEOM_CAPSULE else 0.0
            solid = creation.capsule(length, 1.0, (_TURN // 2, _TURN)).apply_scale(x)
        return solid.apply_transform(self.T)


_SOLIDS = ("SPHERE", "CAPSULE", "CYLINDER", "BOX", "ELLIPSOID", "MESH")
SOLIDS = tuple(int(getattr(mujoco.mjtGeom, f"mjGEOM_{name}")) for name in _SOLIDS)
"""Kinds of geoms that have a surface to fit to."""


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint that moves a link, and those beyond it, against its parent."""

    name: str
    index: int
    """Index in the model."""
    kind: str
    """hinge, slide or other."""
    limits: tuple[float, float] | None
    """Lowest and highest position [rad]; None if the file has none."""
    velocity: float | None
    """Limit [rad/s], if the file has one."""
    effort: float | None
    """Limit [Nm], if the file has one."""
    coupled: bool
    """True if another joint leads it, as `mimic` of a URDF has it."""


@dataclass(frozen=True, eq=False)
class Link:
    """One link."""

    name: str
    parent: int
    """Index of its parent; -1 of the first link."""
    joints: tuple[Joint, ...]
    mass: float
    """[kg]; 0 if the file gives none."""
    shapes: tuple[Shape, ...]
    """Collision shapes, or visual ones where there are none."""
    visual: bool
    """True if they are visual ones."""

    def surface(self) -> Trimesh:
        """Return the triangles of all shapes, link frame."""
        parts = [shape.triangles() for shape in self.shapes]
        return Trimesh(*append_faces([one.vertices for one in parts], [one.faces for one in parts]), process=False)


@dataclass(frozen=True, eq=False)
class Beside:
    """Facts of a URDF that MuJoCo's model does not contain."""

    velocity: dict[str, float] = field(default_factory=dict)
    """Speed limits of joints, as the file has them [rad/s]."""
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Position limits of joints, as the file has them [rad]."""
    mass: dict[str, float] = field(default_factory=dict)
    """Masses of links whose inertia is missing or impossible [kg]."""
    meshes: dict[str, list[tuple[bool, Shape]]] = field(default_factory=dict)
    """Meshes of links, and whether for collision."""
    remarks: list[str] = field(default_factory=list)
    """Omissions and changes, a sentence each."""


@dataclass(frozen=True, eq=False)
class RobotTree:
    """A robot: its links, each after its parent; the first is MuJoCo's world."""

    name: str
    model: mujoco.MjModel
    beside: Beside

    @property
    def remarks(self) -> list[str]:
        """Omissions and assumptions, a sentence each: every stage of an import adds its own."""
        return self.beside.remarks

    @cached_property
    def links(self) -> tuple[Link, ...]:
        """All links; the index of one is that of its body in the model."""
        return tuple(self._link(body) for body in range(self.model.nbody))

    def index(self, name: str) -> int:
        """Return the index of a link; an unknown name is a RobotModelError that lists those there are."""
        names = [link.name for link in self.links]
        if name not in names:
            raise RobotModelError(f"The link {name!r} is unknown: choose from {', '.join(names[1:])}.")
        return names.index(name)

    def ancestors(self, link: int) -> list[int]:
        """Return the links from the first one to this one, itself included."""
        way = []
        while link >= 0:
            way.append(link)
            link = self.links[link].parent
        return way[::-1]

    def _link(self, body: int) -> Link:
        m, name = self.model, self.model.body(body).name or f"link{body}"
        geoms = range(m.body_geomadr[body], m.body_geomadr[body] + m.body_geomnum[body]) if body else range(0)
        solids = [g for g in geoms if m.geom_type[g] in SOLIDS]
        shapes = [(bool(m.geom_contype[g] or m.geom_conaffinity[g]), self._shape(g)) for g in solids]
        shapes += self.beside.meshes.get(name, [])
        visual = not any(collides for collides, _ in shapes)
        first, mass = m.body_jntadr[body], float(m.body_mass[body])
        return Link(
            name,
            int(m.body_parentid[body]) if body else -1,
            tuple(self._joint(j) for j in range(first, first + m.body_jntnum[body])),
            mass if mass > NO_MASS else 0.0,
            tuple(shape for collides, shape in shapes if collides or visual),
            visual,
        )

    def _joint(self, j: int) -> Joint:
        m, name = self.model, self.model.joint(j).name or f"joint{j + 1}"
        low, high = map(float, m.jnt_range[j])
        limits = (low, high) if m.jnt_limited[j] else self.beside.ranges.get(name)
        coupled = (m.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (m.eq_obj1id == j) & (m.eq_obj2id >= 0)
        return Joint(
            name,
            j,
            _KINDS.get(int(m.jnt_type[j]), "other"),
            limits if limits and all(abs(v) < _LARGEST for v in limits) else None,
            _limit(self.beside.velocity.get(name, 0.0)),
            self._effort(j),
            bool(coupled.any()),
        )

    def _effort(self, j: int) -> float | None:
        """Largest torque on a joint [Nm], as its own limit or that of its actuators says; None if neither does."""
        m = self.model
        limits = [np.abs(m.jnt_actfrcrange[j]).max()] if m.jnt_actfrclimited[j] else []
        for a in range(m.nu):
            of_it = m.actuator_trntype[a] == mujoco.mjtTrn.mjTRN_JOINT and m.actuator_trnid[a, 0] == j
            if of_it and m.actuator_forcelimited[a]:
                limits.append(np.abs(m.actuator_forcerange[a]).max() * abs(m.actuator_gear[a, 0]))
        return _limit(float(min(limits, default=0.0)))

    def _shape(self, g: int) -> Shape:
        m, T = self.model, pose(self.model.geom_pos[g], self.model.geom_quat[g])
        if m.geom_type[g] != mujoco.mjtGeom.mjGEOM_MESH:
            return Shape(int(m.geom_type[g]), m.geom_size[g].copy(), T)
        mesh = m.geom_dataid[g]
        corners = m.mesh_vert[m.mesh_vertadr[mesh] :][: m.mesh_vertnum[mesh]]
        faces = m.mesh_face[m.mesh_faceadr[mesh] :][: m.mesh_facenum[mesh]]
        return Shape(int(m.geom_type[g]), m.geom_size[g].copy(), T, lambda: Trimesh(corners, faces, process=False))


def _limit(value: float) -> float | None:
    """Return a limit of a file, None for a number that means none: zero, infinite, or as large as no limit is."""
    return value if 0 < value < _LARGEST else None


def pose(position: FloatArray, quaternion: FloatArray) -> FloatArray:
    """Return the pose (4, 4) of a position (3,) [m] and a quaternion (4,), w first."""
    T, R = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    T[:3, :3], T[:3, 3] = R.reshape(3, 3), position
    return T
