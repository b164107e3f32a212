"""Rays into a simulated room: MuJoCo's own geometry, for geoms that a ray can meet at all.

A handful of rays from one place meets few of them. MuJoCo's function for many rays first finds, for each geom, between
which angles it is seen, which costs more than the rays.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from pretouch.compiled import kernel
from pretouch.sim.mujoco_calls import mj_rayHfield, mj_rayMesh, mju_rayGeom
from pretouch.types import FloatArray, IntArray

_MESH, _HFIELD = int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_HFIELD)
_MARGIN_M2 = 1e-9
"""Rounding must not make a ray miss what it touches [m^2]."""


class Geoms(NamedTuple):
    """The visible geoms (G,) of a scene, in MuJoCo's memory."""

    seen: IntArray  # (V,) those that are visible
    kind: IntArray  # (G,) plane, sphere, capsule, box, mesh and so on
    body: IntArray  # (G,)
    size: FloatArray  # (G, 3)
    reach: FloatArray  # (G,) radius of a ball round each [m]; 0 of a plane, which has none
    position: FloatArray  # (G, 3) centres [m], base frame
    rotation: FloatArray  # (G, 9) rows of the rotation matrices
    model: int  # address of the simulation's model
    data: int  # address of its data


def geoms_of(model: mujoco.MjModel, data: mujoco.MjData) -> Geoms:
    """Return what rays can meet in a simulation: all but transparent geoms."""
    own = model.geom_matid < 0
    alpha = np.where(own, model.geom_rgba[:, 3], 0.0)
    if not own.all():
        alpha[~own] = model.mat_rgba[model.geom_matid[~own], 3]
    return Geoms(
        np.flatnonzero(alpha), model.geom_type, model.geom_bodyid, model.geom_size, model.geom_rbound, data.geom_xpos,
        data.geom_xmat, model._address, data._address,
    )  # fmt: skip


@kernel
def placed(xpos: FloatArray, xmat: FloatArray, T_link_sensor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Origin (3,) [m] and rotation matrix (3, 3) of a sensor in the base frame.

    It sits at T_link_sensor (4, 4) on a body with the origin `xpos` (3,) [m] and the rotation matrix `xmat` (9,), rows.
    """
    origin, R = np.zeros(3), np.zeros((3, 3))
    for i in range(3):
        origin[i] = xpos[i]
        for k in range(3):
            origin[i] += xmat[3 * i + k] * T_link_sensor[k, 3]
            for j in range(3):
                R[i, j] += xmat[3 * i + k] * T_link_sensor[k, j]
    return origin, R


@kernel
def turned(R: FloatArray, cone: FloatArray) -> FloatArray:
    """Unit vectors (N, 3) of a cone in the frame that R (3, 3) brings them to."""
    rays = np.zeros_like(cone)
    for ray in range(len(cone)):
        for i in range(3):
            for j in range(3):
                rays[ray, i] += R[i, j] * cone[ray, j]
    return rays


@kernel
def _along(geoms: Geoms, geom: int, origin: FloatArray, ray: FloatArray, normal: FloatArray) -> float:
    """Return the distance [m] at which a ray meets a geom, -1 if it does not; into `normal` (3,) comes that there."""
    kind = geoms.kind[geom]
    start, along, there = origin.ctypes.data, ray.ctypes.data, normal.ctypes.data
    if kind == _MESH:
        return mj_rayMesh(geoms.model, geoms.data, geom, start, along, there)
    if kind == _HFIELD:
        return mj_rayHfield(geoms.model, geoms.data, geom, start, along, there)
    position, rotation, size = geoms.position[geom], geoms.rotation[geom], geoms.size[geom]
    return mju_rayGeom(position.ctypes.data, rotation.ctypes.data, size.ctypes.data, start, along, kind, there)


@kernel
def cast(
    origin: FloatArray, rays: FloatArray, geoms: Geoms, without: int, farthest: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Distance (N,) [m] and outward normal (N, 3) where unit vectors (N, 3) from `origin` (3,) first meet something.

    And which geom (N,) that is. The distance is -1 where they meet nothing. Not met are geoms of the body `without` and
    those that are all farther than `farthest` [m].
    """
    nearest, normal, struck = np.full(len(rays), -1.0), np.zeros_like(rays), np.zeros(len(rays), np.int64)
    to, there = np.empty(3), np.empty(3)
    for geom in geoms.seen:
        if geoms.body[geom] == without:
            continue
        reach, bounded = geoms.reach[geom], geoms.reach[geom] > 0.0
        for i in range(3):
            to[i] = geoms.position[geom, i] - origin[i]
        away = to[0] * to[0] + to[1] * to[1] + to[2] * to[2]
        if bounded and away > (farthest + reach) ** 2 + _MARGIN_M2:
            continue
        for k in range(len(rays)):
            along = rays[k, 0] * to[0] + rays[k, 1] * to[1] + rays[k, 2] * to[2]
            # past its ball, or with it behind
            if bounded and away - (along * along if along > 0.0 else 0.0) > reach * reach + _MARGIN_M2:
                continue
            distance = _along(geoms, geom, origin, rays[k], there)
            if distance >= 0.0 and (distance < nearest[k] or nearest[k] < 0.0):
                nearest[k], struck[k] = distance, geom
                normal[k] = there
    return nearest, normal, struck
