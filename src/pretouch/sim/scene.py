"""Simulated room: the arm on its pedestal, a floor, static objects and a hand."""

from dataclasses import dataclass

import mujoco
import numpy as np

from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sim.plant_params import PlantParams
from pretouch.types import FloatArray

CONTACTS = "contacts"
"""Name of the sensor that counts the contacts of a scene."""
_IMPEDANCE = 0.01
"""Constant solver impedance d of all contacts; with it and an elliptic cone solref means N/m, see `stiffen`."""


@dataclass(frozen=True)
class Box:
    """A static box."""

    name: str
    center: tuple[float, float, float]
    """[m], base frame."""
    half_size: tuple[float, float, float]
    """[m]"""
    stiffness: float
    """Force per penetration of one link capsule [N/m]."""


@dataclass(frozen=True)
class HandSpec:
    """A person's fist: a ball on a spring, moved by `pretouch.sim.hand`."""

    radius: float = 0.05
    """[m]"""
    mass: float = 0.6
    """Effective mass of a hand in a transient contact [kg] (ISO/TS 15066, annex A)."""
    stiffness: float = 75_000.0
    """Contact stiffness of a hand [N/m] (ISO/TS 15066, annex A)."""
    start: tuple[float, float, float] = (1.2, 0.0, 0.8)
    """[m], base frame."""


@dataclass(frozen=True)
class GhostSpec:
    """A ball that the units see and that touches nothing, moved by whoever builds the scene."""

    radius: float
    """[m]"""
    start: tuple[float, float, float]
    """[m], base frame."""


@dataclass(frozen=True)
class SceneSpec:
    """Objects to build round the arm."""

    boxes: tuple[Box, ...] = ()
    hand: HandSpec | None = None
    ghost: GhostSpec | None = None
    floor_height: float = -0.2
    """Height of the floor in the base frame [m]: the arm stands on a pedestal, or its hand would reach below it."""
    pedestal_radius: float = 0.1
    """[m]"""
    damping_ratio: float = 0.1
    """Damping of a contact as a fraction of critical for 2 kg."""


def described(spec: SceneSpec) -> dict[str, object]:
    """Return what a recording says of a scene, so that it can be drawn again."""
    return {
        "boxes": [{"name": b.name, "center": list(b.center), "half_size": list(b.half_size)} for b in spec.boxes],
        "hand_radius_m": spec.hand.radius if spec.hand else None,
        "floor_height_m": spec.floor_height,
    }


def floor_and_pedestal(floor: float, radius: float = 0.1) -> Fixtures:
    """Return a floor at a height [m], base frame, and a pedestal of a radius [m] under the arm."""
    return Fixtures(
        planes=np.array([[0.0, 0.0, 1.0, floor]]),
        capsules=Capsules(
            link=np.zeros(1, np.int64),
            a=np.array([[0.0, 0.0, floor]]),
            # the rounded top ends at the origin, where the arm begins
            b=np.array([[0.0, 0.0, -radius]]),
            radius=np.array([radius]),
        ),
    )


def fixtures(spec: SceneSpec) -> Fixtures:
    """Return the fixtures that a controller is given: floor and pedestal, not the objects."""
    return floor_and_pedestal(spec.floor_height, spec.pedestal_radius)


_HOOK_M = (0.0, 0.0, 1.4)
"""Where the cable begins [m], base frame."""


@dataclass(frozen=True)
class ArmError:
    """Differences of the simulated arm from its model."""

    params: PlantParams
    """Parameters of the kind of arm: rotor inertia and cable."""
    mass_factor: FloatArray
    """(L,) factor on each link's mass and inertia."""
    payload: float
    """Unknown mass at the TCP [kg]."""


def build(model: RobotModel, spec: SceneSpec, error: ArmError) -> mujoco.MjModel:
    """Build the MuJoCo model of a scene. Only declared pairs touch.

    Each moving capsule touches floor, boxes and hand; the hand also touches all that stands still.
    """
    mj, moving, still = _arm(model, error)
    mj.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    stiffness = _add_objects(mj, spec)
    pairs = [(link, thing) for link in moving for thing in stiffness]
    if spec.hand:
        pairs += [(thing, "hand") for thing in [*still, "pedestal", *stiffness] if thing != "hand"]
    friction, impedance = [0.5, 0.5, 0.005, 0.0001, 0.0001], [_IMPEDANCE, _IMPEDANCE, 0.001, 0.5, 2.0]
    for one, other in pairs:
        mj.add_pair(geomname1=one, geomname2=other, condim=3, friction=friction, solimp=impedance)
    found_flag = 1 << int(mujoco.mjtConDataField.mjCONDATA_FOUND)
    mj.add_sensor(name=CONTACTS, type=mujoco.mjtSensor.mjSENS_CONTACT, intprm=[found_flag, 0, 1])
    built, links = mj.compile(), slice(1, len(error.mass_factor))
    built.body_mass[links] *= error.mass_factor[1:]
    built.body_inertia[links] *= error.mass_factor[1:, None]
    mujoco.mj_setConst(built, mujoco.MjData(built))
    for thing, of_it in stiffness.items():
        stiffen(built, thing, of_it, spec.damping_ratio)
    return built


def _arm(model: RobotModel, error: ArmError) -> tuple[mujoco.MjSpec, list[str], list[str]]:
    """Return an arm without its actuators and with what it carries; and the names of its geoms that move, and not."""
    mj = mujoco.MjSpec.from_file(str(model.description.mjcf))
    mj.option.gravity = model.gravity
    for actuator in list(mj.actuators):
        mj.delete(actuator)
    for joint in mj.joints:
        joint.armature = error.params.armature_kg_m2
        joint.damping = np.zeros_like(joint.damping)
    moving = [geom.name for geom in mj.geoms if model.moved_by[model.link_index(geom.parent.name)].any()]
    still = [geom.name for geom in mj.geoms if geom.name not in moving]
    if error.payload > 0:
        body = mj.body(model.description.ee_body).add_body(name="payload")
        body.mass, body.inertia = error.payload, np.full(3, 1e-5)
        body.explicitinertial = True
    if error.params.cable_n_m:
        _add_cable(mj, model, error.params)
    return mj, moving, still


def _add_cable(mj: mujoco.MjSpec, model: RobotModel, params: PlantParams) -> None:
    """Hang a cable at the hand: a tendon with a range of lengths at which it is slack."""
    hand = mj.body(model.description.ee_body)
    mj.worldbody.add_site(name="hook", pos=_HOOK_M)
    hand.add_site(name="plug")
    weight = hand.add_body(name="cable")
    weight.mass, weight.inertia, weight.explicitinertial = max(params.cable_kg, 1e-6), np.full(3, 1e-6), True
    ready = model.kinematics(model.description.q_ready).position[model.ee]
    taut = float(np.linalg.norm(ready - _HOOK_M)) + params.cable_slack_m
    tendon = mj.add_tendon(
        name="cable", stiffness=params.cable_n_m, springlength=[0.0, taut], frictionloss=params.cable_friction_n
    )
    for site in ("hook", "plug"):
        tendon.wrap_site(site)


def _add_objects(mj: mujoco.MjSpec, spec: SceneSpec) -> dict[str, float]:
    """Add floor, pedestal, boxes, hand and ghost; return the stiffness of each geom the arm can touch."""
    world = mj.worldbody
    off = {"contype": 0, "conaffinity": 0}
    kind = mujoco.mjtGeom
    world.add_geom(name="floor", type=kind.mjGEOM_PLANE, size=[3, 3, 0.1], pos=[0, 0, spec.floor_height], **off)
    axis, size = [0, 0, spec.floor_height, 0, 0, -spec.pedestal_radius], [spec.pedestal_radius, 0, 0]
    world.add_geom(name="pedestal", type=kind.mjGEOM_CAPSULE, fromto=axis, size=size, **off)
    stiffness = {"floor": 100_000.0}
    for thing in spec.boxes:
        world.add_geom(name=thing.name, type=kind.mjGEOM_BOX, size=thing.half_size, pos=thing.center, **off)
        stiffness[thing.name] = thing.stiffness
    if spec.hand:
        body = world.add_body(name="hand", pos=spec.hand.start, gravcomp=1.0)
        for along in np.eye(3):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=along)
        body.add_geom(name="hand", type=kind.mjGEOM_SPHERE, size=[spec.hand.radius, 0, 0], mass=spec.hand.mass, **off)
        stiffness["hand"] = spec.hand.stiffness
    if spec.ghost:  # in no pair, so it touches nothing
        body = world.add_body(name="ghost", pos=spec.ghost.start, mocap=True)
        body.add_geom(name="ghost", type=kind.mjGEOM_SPHERE, size=[spec.ghost.radius, 0, 0], **off)
    return stiffness


def stiffen(built: mujoco.MjModel, thing: str, stiffness: float, damping_ratio: float) -> None:
    """Make each contact with a thing a spring of `stiffness` [N/m] and a damper; of two things, the later call counts.

    MuJoCo's direct solref (-K, -B) is normalised by the inverse masses w that meet in the contact: K = k (1 - d) w.
    """
    geom, damping = built.geom(thing).id, damping_ratio * 2.0 * np.sqrt(stiffness * 2.0)
    for i, pair in enumerate(zip(built.pair_geom1, built.pair_geom2, strict=True)):
        if geom in pair:
            w = sum(float(built.body_invweight0[built.geom_bodyid[g], 0]) for g in pair)
            built.pair_solref[i] = np.array([-stiffness, -damping]) * (1.0 - _IMPEDANCE) * w
