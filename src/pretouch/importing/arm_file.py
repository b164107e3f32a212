"""An arm as an MJCF file: joint frames, limits, inertials and capsules, and no meshes; written by MuJoCo."""

import mujoco
import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.capsules import LinkBody
from pretouch.importing.chain import ArmChain, Limits
from pretouch.types import FloatArray

DENSITY = 1000.0
"""Density of a link of unknown mass, over its capsules: MuJoCo's default [kg/m^3]."""
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6
"""Mass and inertia of a moved link without any data [kg, kg m^2]."""
_LARGEST_MASS = 500.0
"""Mass that no link of an arm exceeds [kg]."""


def arm_file(name: str, arm: ArmChain, limits: Limits, bodies: tuple[LinkBody, ...]) -> str:
    """Return the MJCF of an arm, numbers to six digits.

    A link without any inertial has that of its capsules, if a joint moves it and nothing that is fixed to it has a
    mass. One with a mass alone has the inertia of its capsules.
    """
    links, rods, T = arm.robot.links, {body.name: body.rods for body in bodies}, _poses(arm)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.modelname, spec.option.timestep, spec.option.integrator = name, 0.001, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    model, placed, estimates = arm.robot.model, [spec.worldbody], list[str]()
    for i, link in enumerate(links):
        if i:
            within, quaternion = np.linalg.solve(T[link.parent], T[i]), np.zeros(4)
            mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(within[:3, :3]).ravel())
            placed.append(placed[link.parent].add_body(name=link.name, pos=within[:3, 3], quat=quaternion))
        for joint in (joint for joint in link.joints if joint in arm.joints):
            j = arm.joints.index(joint)
            placed[i].add_joint(
                name=joint.name,
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=model.jnt_axis[joint.index],
                pos=model.jnt_pos[joint.index],
                ref=float(model.qpos0[model.jnt_qposadr[joint.index]]),
                range=[limits.q_min[j], limits.q_max[j]],
                actfrcrange=[-float(limits.tau_max[j]), float(limits.tau_max[j])],
            )
        density = _set_inertial(placed[i], arm, i, rods.get(link.name), estimates)
        for k, rod in enumerate(rods.get(link.name, ())):
            capsule = placed[i].add_geom(
                name=f"{link.name}_{k}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[rod[6], 0, 0]
            )
            capsule.fromto, capsule.density = rod[:6], density
            capsule.contype, capsule.conaffinity, capsule.group = 1, 2, 3
    if heavy := [f"{link.name} ({link.mass:g} kg)" for link in links if link.mass > _LARGEST_MASS]:
        arm.robot.remarks.append(f"Implausible masses, correct them in the file: {', '.join(heavy)}.")
    if estimates:
        arm.robot.remarks.append(
            f"Without a mass or inertia that is possible, so estimated at {DENSITY:g} kg/m^3: {', '.join(estimates)}."
            " Simulated forces are only as accurate as that: give each its mass and inertia in the file."
        )
    try:
        spec.compile()
    except ValueError as error:
        raise RobotModelError(f"{name} is no arm that MuJoCo takes: {' '.join(str(error).split())}.") from error
    return spec.to_xml()


def _poses(arm: ArmChain) -> FloatArray:
    """Poses of all links (L, 4, 4), the arm's joints where the file draws them and all others fixed."""
    model = arm.robot.model
    data = mujoco.MjData(model)
    for joint in (joint for link in arm.robot.links for joint in link.joints):
        if joint not in arm.joints and joint.kind != "other":
            low, high = joint.limits or (-np.inf, np.inf)
            data.qpos[model.jnt_qposadr[joint.index]] = min(max(0.0, low), high)
    mujoco.mj_kinematics(model, data)
    T = np.tile(np.eye(4), (model.nbody, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = data.xmat.reshape(-1, 3, 3), data.xpos
    return T


def _set_inertial(body: mujoco.MjsBody, arm: ArmChain, i: int, rods: FloatArray | None, estimates: list[str]) -> float:
    """Give a body the inertial of its link; return the density of its capsules [kg/m^3] where it has none.

    A mass or inertia that is estimated is added to `estimates`.
    """
    link, model = arm.robot.links[i], arm.robot.model
    mass = arm.robot.beside.mass.get(link.name, 0.0)
    if link.mass > 0:
        body.mass, body.ipos, body.iquat = link.mass, model.body_ipos[i], model.body_iquat[i]
        body.inertia, body.explicitinertial = model.body_inertia[i], True
        return 0.0
    if mass > 0 and rods is not None:
        estimates.append(f"{link.name} (inertia only, of {mass:.2g} kg)")
        return mass / _volume(rods)
    if not _needs_mass(arm, i):
        return 0.0
    if rods is None:
        body.mass, body.inertia, body.explicitinertial = _LEAST_MASS, [_LEAST_INERTIA] * 3, True
    wrong = f"{mass:g} kg in the file, " if mass else ""
    estimates.append(f"{link.name} ({wrong}{_LEAST_MASS if rods is None else DENSITY * _volume(rods):.2g} kg)")
    return DENSITY


def _needs_mass(arm: ArmChain, link: int) -> bool:
    """Return True if a joint of the arm moves the link and neither it nor a link fixed to it has a mass."""
    links, masses, fixed = arm.robot.links, arm.robot.beside.mass, {link}
    for i in range(link + 1, len(links)):
        if links[i].parent in fixed and not arm.moves(i):
            fixed.add(i)
    return arm.moves(link) and not any(links[i].mass > 0 or masses.get(links[i].name, 0.0) > 0 for i in fixed)


def _volume(rods: FloatArray) -> float:
    """Volume of capsules [m^3]; where two overlap it counts twice."""
    length, radius = np.linalg.norm(rods[:, 3:6] - rods[:, :3], axis=1), rods[:, 6]
    return float((np.pi * radius**2 * (length + 4 / 3 * radius)).sum())
