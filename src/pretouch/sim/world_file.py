"""A world from somebody's MJCF file round the simulated arm."""

from pathlib import Path

import mujoco
import numpy as np

from pretouch.errors import ParameterError
from pretouch.types import FloatArray

_PREFIX = "world/"
"""Names of the file may be those of the arm, too."""
_BASE = "base"
_PHYSICS = ("gravity", "wind", "density", "viscosity", "disableflags")
"""Options that change what happens, and not how well it is computed."""
_NEVER_MOVED = {"nu": "actuators", "nflex": "deformable bodies", "nplugin": "plugins"}
"""Parts that the simulation neither moves nor shows."""
_VISUAL = ("global_", "quality", "headlight", "map", "scale", "rgba")
_SIZES = ("memory", "njmax", "nconmax", "nstack", "nuserdata")
_UPRIGHT = 1e-6


def attach_world(arm: mujoco.MjSpec, file: Path) -> None:
    """Put the world of an MJCF file round an arm, whose base stands at the site `base`, or else at the origin.

    Its shapes touch the arm and each other as the file says. How the physics is computed stays the arm's.
    A file that cannot be used is a ParameterError.
    """
    try:
        alone, world = mujoco.MjModel.from_xml_path(str(file)), mujoco.MjSpec.from_file(str(file))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ParameterError(f"The scene {file} cannot be read as MJCF: {reason}") from None
    _check(alone, file)
    frame = arm.worldbody.add_frame()
    frame.pos, frame.quat = _in_base(alone, file, arm.option.gravity)
    _settle_differences(world, arm)
    arm.attach(world, prefix=_PREFIX, frame=frame)


def _check(alone: mujoco.MjModel, file: Path) -> None:
    for count, things in _NEVER_MOVED.items():
        if getattr(alone, count):
            raise ParameterError(f"The scene {file} has {things}, which are not simulated: take them out.")
    usual = mujoco.MjSpec().compile().opt
    for name in _PHYSICS:
        value, expected = (np.asarray(getattr(opt, name)) for opt in (alone.opt, usual))
        if np.any(value != expected):
            raise ParameterError(
                f"The scene {file} has the option {name} {value}, and the arm's world has {expected}: take it out."
            )


def _in_base(alone: mujoco.MjModel, file: Path, gravity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return origin [m] and quaternion of the file's world in the frame of the arm's base, which has this gravity."""
    data, position, quat, turned = mujoco.MjData(alone), np.zeros(3), np.empty(4), np.eye(3)
    mujoco.mj_kinematics(alone, data)
    site = mujoco.mj_name2id(alone, mujoco.mjtObj.mjOBJ_SITE, _BASE)
    if site >= 0:
        position, turned = data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
    tilted = np.linalg.norm(turned.T @ alone.opt.gravity - gravity) > _UPRIGHT * np.linalg.norm(gravity)
    if tilted or (site >= 0 and alone.body_weldid[alone.site_bodyid[site]]):
        raise ParameterError(
            f"The site {_BASE} of the scene {file} moves or is tilted: the arm stands still, with gravity along"
            f" {gravity.round(2)} in its base frame."
        )
    mujoco.mju_mat2Quat(quat, turned.ravel())
    of_world = np.empty(3), np.empty(4)
    mujoco.mju_negPose(*of_world, position, quat)
    return of_world


def _settle_differences(world: mujoco.MjSpec, arm: mujoco.MjSpec) -> None:
    """Give what concerns all at once the arm's values: MuJoCo keeps those anyway, and warns where they differ."""
    parts = [(getattr(world.visual, part), getattr(arm.visual, part)) for part in _VISUAL]
    for one, other in [(world.option, arm.option), *parts]:
        for name in dir(other):
            if not name.startswith("_"):
                setattr(one, name, getattr(other, name))
    for name in [*_SIZES, *(name for name in dir(arm) if name.startswith("nuser_"))]:
        setattr(world, name, getattr(arm, name))
