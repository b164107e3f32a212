"""Reading of MJCF files, by MuJoCo itself."""

from pathlib import Path

import mujoco
import numpy as np
from trimesh import Trimesh

from pretouch.errors import RobotModelError
from pretouch.importing.solids import Block, Cylinder, Ellipsoid, Rounded, Shape
from pretouch.importing.source import WORLD, Inertial, Source, SourceJoint, SourceLink
from pretouch.types import FloatArray

_KINDS = {int(mujoco.mjtJoint.mjJNT_HINGE): "hinge", int(mujoco.mjtJoint.mjJNT_SLIDE): "slide"}


def read_mjcf(file: Path) -> Source:
    """Read a robot from an MJCF file. What is wrong with it is a RobotModelError."""
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        raise RobotModelError(f"The MJCF file {file} cannot be read: {' '.join(str(error).split())}.") from error
    links = tuple(_link(model, body) for body in range(model.nbody))
    remarks = []
    if model.neq:
        remarks.append(f"{model.neq} equality constraints of the MJCF are left out.")
    of_dofs = (model.dof_armature, model.dof_damping, model.dof_frictionloss)
    told = {int(j) for j in np.flatnonzero(model.jnt_stiffness)}
    told |= {int(model.dof_jntid[dof]) for values in of_dofs for dof in np.flatnonzero(values)}
    if told:
        names = ", ".join(model.joint(j).name or f"joint{j + 1}" for j in sorted(told))
        remarks.append(f"Armature, damping, friction and springs of the joints are left out: {names}.")
    ignored = [g for g in range(model.ngeom) if _shape(model, g) is None and model.geom_bodyid[g]]
    if ignored:
        remarks.append(f"{len(ignored)} shapes that are planes, height fields or the like are left out.")
    names = model.names.split(b"\0")[0].decode("utf-8", "replace")
    return Source(names or file.stem, links, tuple(remarks))


def _link(model: mujoco.MjModel, body: int) -> SourceLink:
    geoms = range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]) if body else range(0)
    shapes = [(g, shape) for g in geoms if (shape := _shape(model, g)) is not None]
    joints = range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body])
    return SourceLink(
        name=model.body(body).name or f"link{body}" if body else WORLD,
        parent=int(model.body_parentid[body]) if body else -1,
        T_parent_link=_pose(model.body_pos[body], model.body_quat[body]) if body else np.eye(4),
        joints=tuple(_joint(model, j) for j in joints),
        inertial=_inertial(model, body),
        collision=tuple(shape for g, shape in shapes if model.geom_contype[g] or model.geom_conaffinity[g]),
        visual=tuple(shape for g, shape in shapes if not (model.geom_contype[g] or model.geom_conaffinity[g])),
    )


def _joint(model: mujoco.MjModel, j: int) -> SourceJoint:
    kind = _KINDS.get(int(model.jnt_type[j]), "other")
    address = model.jnt_qposadr[j]
    return SourceJoint(
        name=model.joint(j).name or f"joint{j + 1}",
        kind=kind,  # type: ignore[arg-type]
        axis=model.jnt_axis[j].copy(),
        position=model.jnt_pos[j].copy(),
        limits=(float(model.jnt_range[j, 0]), float(model.jnt_range[j, 1])) if model.jnt_limited[j] else None,
        effort=_effort(model, j),
        coupled=_coupled(model, j),
        reference=float(model.qpos0[address]) if kind != "other" else 0.0,
    )


def _effort(model: mujoco.MjModel, j: int) -> float | None:
    """Largest torque on a joint [Nm], as its own limit or that of its actuators says; None if neither does."""
    found = []
    if model.jnt_actfrclimited[j]:
        found.append(np.abs(model.jnt_actfrcrange[j]).max())
    for a in range(model.nu):
        of_it = model.actuator_trntype[a] == mujoco.mjtTrn.mjTRN_JOINT and model.actuator_trnid[a, 0] == j
        if of_it and model.actuator_forcelimited[a]:
            found.append(np.abs(model.actuator_forcerange[a]).max() * abs(model.actuator_gear[a, 0]))
    return float(min(found)) if found and min(found) > 0 else None


def _coupled(model: mujoco.MjModel, j: int) -> bool:
    """Whether an equality makes the joint follow another one."""
    return any(
        model.eq_type[e] == mujoco.mjtEq.mjEQ_JOINT and model.eq_obj1id[e] == j and model.eq_obj2id[e] >= 0
        for e in range(model.neq)
    )


def _inertial(model: mujoco.MjModel, body: int) -> Inertial | None:
    if not body or model.body_mass[body] <= 0:
        return None
    R = _pose(np.zeros(3), model.body_iquat[body])[:3, :3]
    inertia = R @ np.diag(model.body_inertia[body]) @ R.T
    return Inertial(float(model.body_mass[body]), model.body_ipos[body].copy(), inertia)


def _shape(model: mujoco.MjModel, g: int) -> Shape | None:
    kinds, T = mujoco.mjtGeom, _pose(model.geom_pos[g], model.geom_quat[g])
    x, y, z = (float(v) for v in model.geom_size[g])
    kind = model.geom_type[g]
    if kind == kinds.mjGEOM_SPHERE:
        return Shape(Rounded(x, 0.0), T)
    if kind == kinds.mjGEOM_CAPSULE:
        return Shape(Rounded(x, y), T)
    if kind == kinds.mjGEOM_CYLINDER:
        return Shape(Cylinder(x, y), T)
    if kind == kinds.mjGEOM_BOX:
        return Shape(Block((x, y, z)), T)
    if kind == kinds.mjGEOM_ELLIPSOID:
        return Shape(Ellipsoid((x, y, z)), T)
    if kind == kinds.mjGEOM_MESH:
        return Shape(_mesh(model, int(model.geom_dataid[g])), T)
    return None


def _mesh(model: mujoco.MjModel, mesh: int) -> Trimesh:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    face, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return Trimesh(model.mesh_vert[first : first + count], model.mesh_face[face : face + faces], process=False)


def _pose(position: FloatArray, quaternion: FloatArray) -> FloatArray:
    T, R = np.eye(4), np.zeros(9)
    mujoco.mju_quat2Mat(R, quaternion)
    T[:3, :3], T[:3, 3] = R.reshape(3, 3), position
    return T
