"""What a simulation of an arm that does not come with the package has to assume: its floor, and a sentence for each."""

import numpy as np

from pretouch.coverage.placement import postures_along
from pretouch.robot.model import RobotModel
from pretouch.robot.named import is_shipped
from pretouch.robot.self_distance import capsule_ends, kinematics_of
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.plant_params import assumed_plant
from pretouch.sim.scene import SceneSpec

_ROOM_M = 0.1
"""Between the floor and the lowest that the arm comes on its paths [m]: a push moves it further."""


def floor_under(model: RobotModel, placement: Placement) -> float:
    """Return the height of the floor below an arm's paths in the base frame [m]: the Panda's, or as low as it takes."""
    usual = SceneSpec.floor_height
    if is_shipped(model.description):
        return usual
    found = [postures_along(model, placement.path(trajectory, 1.0)) for trajectory in ("circle", "line")]
    postures = np.concatenate([one for one in found if one is not None])
    moving = np.flatnonzero(model.moved_by[model.capsules.link].any(axis=1))
    ends = capsule_ends(model, kinematics_of(model, postures))[..., 2][:, moving]
    lowest = float((ends - model.capsules.radius[moving, None]).min())
    return min(usual, round(lowest - _ROOM_M, 2))


def assumptions(model: RobotModel, placement: Placement, floor: float) -> tuple[str, ...]:
    """Say what a simulation of an arm assumes, a sentence each; nothing of one that comes with the package.

    Nothing is said of paths that are where the paper has them.
    """
    arm = model.description
    if is_shipped(arm):
        return ()
    moved = (placement.sentence(arm.name),) if placement != Placement() else ()
    low = f"The floor is at {floor:.2f} m, for on its paths the arm reaches lower than a Panda."
    lower = (low,) if floor < SceneSpec.floor_height else ()
    return (*moved, *lower, assumed_plant(arm))
