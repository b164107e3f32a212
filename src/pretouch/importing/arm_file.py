"""An arm as an MJCF file: joint frames, limits, inertials and capsules, and no meshes; written by MuJoCo."""

import mujoco
import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.capsules import LinkBody, Rods
from pretouch.importing.chain import Arm
from pretouch.importing.limits import Limits
from pretouch.types import FloatArray

DENSITY = 1000.0
"""Of a link whose mass is unknown, over its capsules: MuJoCo's own [kg/m^3]."""
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6
"""Of a moved link of which nothing is known [kg, kg m^2]."""
_LARGEST_MASS = 500.0
"""What no link of an arm has [kg]."""


def arm_file(name: str, arm: Arm, limits: Limits, bodies: tuple[LinkBody, ...]) -> tuple[str, tuple[str, ...]]:
    """Return the MJCF of an arm, numbers to six digits, and a sentence for each mass or inertia that is estimated.

    A link without any inertial has that of its capsules, if a joint moves it and nothing that is fixed to it has a
    mass. One with a mass alone has the inertia of its capsules.
    """
    links, model, known = arm.robot.links, arm.robot.model, arm.robot.beside.mass
    rods, T = {body.name: body.rods for body in bodies}, _poses(arm)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.modelname, spec.option.timestep, spec.option.integrator = name, 0.001, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    placed, estimated = [spec.worldbody], list[str]()
    for i, link in enumerate(links):
        if i:
            position, quaternion = _in_parent(T[link.parent], T[i])
            placed.append(placed[link.parent].add_body(name=link.name, pos=position, quat=quaternion))
        body, mass = placed[i], known.get(link.name, 0.0)
        for joint in (joint for joint in link.joints if joint in arm.joints):
            _add_joint(body, arm, limits, arm.joints.index(joint))
        density = 0.0
        if link.mass > 0:
            body.mass, body.ipos, body.iquat = link.mass, model.body_ipos[i], model.body_iquat[i]
            body.inertia, body.explicitinertial = model.body_inertia[i], True
        elif mass > 0 and link.name in rods:
            density = mass / _volume(rods[link.name]).sum()
            estimated.append(f"{link.name} (inertia only, of {mass:.2g} kg)")
        elif _needs_mass(arm, i):
            density = DENSITY
            wrong = f"{mass:g} kg in the file, " if mass else ""
            estimated.append(f"{link.name} ({wrong}{_estimate(body, rods.get(link.name)):.2g} kg)")
        _add_capsules(body, link.name, rods.get(link.name), density)
    remarks = []
    if heavy := [f"{link.name} ({link.mass:g} kg)" for link in links if link.mass > _LARGEST_MASS]:
        remarks.append(f"Implausible masses, correct them in the file: {', '.join(heavy)}.")
    if estimated:
        remarks.append(
            f"Without a mass or inertia that is possible, so estimated at {DENSITY:g} kg/m^3: {', '.join(estimated)}."
            " Simulated forces are only as accurate as that: give each its mass and inertia in the file."
        )
    try:
        spec.compile()
    except ValueError as error:
        raise RobotModelError(f"{name} is no arm that MuJoCo takes: {' '.join(str(error).split())}.") from error
    return spec.to_xml(), tuple(remarks)


def _poses(arm: Arm) -> FloatArray:
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


def _in_parent(parent: FloatArray, own: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Position (3,) and quaternion (4,) of a pose in another one, both (4, 4)."""
    T = np.asarray(np.linalg.solve(parent, own), dtype=np.float64)
    quaternion: FloatArray = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(T[:3, :3]).ravel())
    return T[:3, 3], quaternion


def _add_joint(body: mujoco.MjsBody, arm: Arm, limits: Limits, j: int) -> None:
    joint, model, torque = arm.joints[j], arm.robot.model, float(limits.tau_max[j])
    body.add_joint(
        name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=model.jnt_axis[joint.index],
        pos=model.jnt_pos[joint.index], ref=float(model.qpos0[model.jnt_qposadr[joint.index]]),
        range=[limits.q_min[j], limits.q_max[j]], actfrcrange=[-torque, torque],
    )  # fmt: skip


def _add_capsules(body: mujoco.MjsBody, link: str, rods: Rods | None, density: float) -> None:
    ends = [] if rods is None else zip(rods.a, rods.b, rods.radius, strict=True)
    for k, (a, b, radius) in enumerate(ends):
        body.add_geom(
            name=f"{link}_{k}", type=mujoco.mjtGeom.mjGEOM_CAPSULE, size=[radius, 0, 0], fromto=[*a, *b],
            contype=1, conaffinity=2, group=3, density=density,
        )  # fmt: skip


def _needs_mass(arm: Arm, link: int) -> bool:
    """Whether a joint of the arm moves the link and neither it nor what is fixed to it has a mass."""
    links = arm.robot.links
    if not any(joint in arm.joints for joint in links[link].joints):
        return False
    fixed = {link}
    for i in range(link + 1, len(links)):
        if links[i].parent in fixed and not any(joint in arm.joints for joint in links[i].joints):
            fixed.add(i)
    return not any(links[i].mass > 0 or arm.robot.beside.mass.get(links[i].name, 0.0) > 0 for i in fixed)


def _estimate(body: mujoco.MjsBody, rods: Rods | None) -> float:
    """Return the mass that a link's capsules give it [kg]; without capsules, give it the least."""
    if rods is not None:
        return float(DENSITY * _volume(rods).sum())
    body.mass, body.inertia, body.explicitinertial = _LEAST_MASS, [_LEAST_INERTIA] * 3, True
    return _LEAST_MASS


def _volume(rods: Rods) -> FloatArray:
    """Volumes (K,) of capsules [m^3]; where two overlap it counts twice."""
    return np.pi * rods.radius**2 * (np.linalg.norm(rods.b - rods.a, axis=1) + 4 / 3 * rods.radius)
