"""Import of a robot's file as the folder of an arm, which the rest of the package takes.

Its MJCF file has joint frames, limits, inertials and capsules, and no meshes; MuJoCo writes it.
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from pretouch.errors import RobotModelError
from pretouch.importing.capsules import MOST, LinkBody, bodies_of
from pretouch.importing.chain import ArmChain, Limits, arm_of, limits_of
from pretouch.importing.read import read_robot
from pretouch.importing.ready import Ready, check_posture, proposed, rated
from pretouch.robot.description import FILE, RobotDescription, description_text
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

MJCF = "arm.xml"
_DENSITY = 1000.0
"""Density of a link of unknown mass, over its capsules: MuJoCo's default [kg/m^3]."""
_LEAST_MASS, _LEAST_INERTIA = 1e-3, 1e-6
"""Mass and inertia of a moved link without any data [kg, kg m^2]."""
_LARGEST_MASS = 500.0
"""Mass that no link of an arm exceeds [kg]."""


@dataclass(frozen=True, kw_only=True)
class ImportOptions:
    """Facts that a robot's file does not contain: options of `pretouch robot import`."""

    ee: str = ""
    """Link whose origin is the end-effector; by default the most likely one."""
    name: str = ""
    """Name of the arm; by default the file's."""
    package_path: tuple[Path, ...] = ()
    """Folders that hold the ROS packages of package:// paths; those above the file are searched in any case."""
    xacro: tuple[str, ...] = ()
    """Arguments of a xacro file, as NAME:=VALUE."""
    qd_max: tuple[float, ...] = ()
    """Joint velocity limits [rad/s], one for all or one for each; by default the file's."""
    qdd_max: tuple[float, ...] = ()
    """Joint acceleration limits [rad/s^2]; no file has them."""
    tau_max: tuple[float, ...] = ()
    """Joint torque limits [Nm]; by default the file's."""
    ready: tuple[float, ...] = ()
    """Usual posture to start from [rad], one position for each joint; by default one is searched for."""
    gravity: tuple[float, ...] = (0.0, 0.0, -1.0)
    """Direction of gravity in the base frame, of any length: 0,0,1 for an arm that hangs."""
    capsules: int = MOST
    """Largest number of capsules per link."""
    cover: bool = False
    """Enlarge the capsules until no surface sticks out of them: the arm then keeps more distance than necessary."""


@dataclass(frozen=True, eq=False)
class Imported:
    """An arm that was read, and how good what stands for it is."""

    mjcf_text: str
    model: RobotModel
    """The MJCF file of its description has the name `MJCF` and is gone; `mjcf_text` is what was in it."""
    bodies: tuple[LinkBody, ...]
    ready: Ready
    remarks: tuple[str, ...]
    """Assumptions and omissions, a sentence each."""


def import_robot(file: Path, options: ImportOptions) -> Imported:
    """Read an arm, fit capsules, and propose what the file does not hold. Foreseeable misuse is a RobotModelError."""
    if not 1 <= options.capsules <= 10:
        raise RobotModelError(f"--capsules is {options.capsules}: give 1 to 10 for one link.")
    robot = read_robot(file, options.package_path, options.xacro)
    arm = arm_of(robot, options.ee)
    limits = limits_of(arm, options.qd_max, options.qdd_max, options.tau_max)
    if options.ready:
        check_posture(np.array(options.ready), limits.q_min, limits.q_max, "--ready")
    bodies, name = bodies_of(arm, options.capsules, options.cover), options.name or robot.name
    text = arm_file(name, arm, limits, bodies)
    with tempfile.TemporaryDirectory(prefix="pretouch-") as folder:
        mjcf = Path(folder) / MJCF
        mjcf.write_text(text, encoding="utf-8")
        description = RobotDescription(
            name,
            mjcf,
            robot.links[arm.ee].name,
            limits.qd_max,
            limits.qdd_max,
            limits.tau_max,
            (limits.q_min + limits.q_max) / 2,
            f"imported from {file.name}",
            gravity=np.array(options.gravity),
        )
        model = RobotModel(description)
        ready = rated(model, np.array(options.ready)) if options.ready else proposed(model, robot.remarks)
        model = RobotModel(replace(description, q_ready=ready.q))
    return Imported(text, model, bodies, ready, tuple(robot.remarks))


def check_free(folder: Path) -> None:
    """Raise RobotModelError if a folder is there."""
    if folder.exists() or folder.is_symlink():
        raise RobotModelError(f"The folder {folder} exists already: give another --out, or remove it.")


def write_folder(imported: Imported, folder: Path) -> None:
    """Write an arm's folder; one that is there is a RobotModelError."""
    check_free(folder)
    try:
        folder.mkdir(parents=True)
        (folder / MJCF).write_text(imported.mjcf_text, encoding="utf-8")
        (folder / FILE).write_text(description_text(imported.model.description), encoding="utf-8")
    except OSError as error:
        raise RobotModelError(
            f"The folder {folder} cannot be written: {error.strerror}: give another --out."
        ) from error


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
            f"Without a mass or inertia that is possible, so estimated at {_DENSITY:g} kg/m^3: {', '.join(estimates)}."
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
    estimates.append(f"{link.name} ({wrong}{_LEAST_MASS if rods is None else _DENSITY * _volume(rods):.2g} kg)")
    return _DENSITY


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
