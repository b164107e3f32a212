"""The postures that coverage is averaged over: on the paper's paths, or in the joints' whole range."""

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, ever_apart, kinematics_of, self_distances
from pretouch.sim.paper_scenes import placement_for
from pretouch.types import FloatArray

KINDS = ("circle", "line", "paths", "joints")
_DRAWN = 40
"""Postures drawn at most for each that is wanted: many meet the arm itself or the floor."""


def postures(
    model: RobotModel, room: Fixtures, workspace: str, count: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray | None]:
    """Draw postures of a workspace (S, n) [rad], and unit tangents of the hand's path there (S, 3), base frame.

    `circle` and `line` are the paper's paths, `paths` both, the hand upright; `joints` is the whole range of the
    joints, where the arm is clear of itself and of the room, and has no path: None. Raises ExperimentError for anything
    else, and where the arm cannot be.
    """
    if count < 2:
        raise ExperimentError(f"The number of postures is {count}: give at least 2.")
    if workspace == "joints":
        return _anywhere(model, room, count, rng), None
    if workspace not in KINDS:
        raise ExperimentError(f"The workspace is {workspace!r}: give {', '.join(KINDS)}.")
    place = placement_for(model)
    paths = [place.path(name, 1.0) for name in (("circle", "line") if workspace == "paths" else (workspace,))]
    parts = np.array_split((np.arange(count) + rng.uniform(size=count)) / count, len(paths))
    at = [(path, p * len(paths) % 1.0 * path.length) for path, part in zip(paths, parts, strict=True) for p in part]
    q = np.array([brought_to(model, path.point(phase)) for path, phase in at])
    return q, np.array([path.tangent(phase) for path, phase in at])


def _anywhere(model: RobotModel, room: Fixtures, count: int, rng: np.random.Generator) -> FloatArray:
    """Postures (S, n) in which the arm is clear of itself, and its moving part on the free side of all planes."""
    half, apart = np.minimum((model.q_max - model.q_min) / 2, np.pi), ever_apart(model)
    moving = np.isin(model.capsules.link, model.parts)
    drawn = model.q_mid + half * rng.uniform(-1, 1, (_DRAWN * count, model.n))
    free = list[FloatArray]()
    for q in drawn:
        ends = capsule_ends(model, kinematics_of(model, q[None]))
        heights = ends[0, moving] @ room.planes[:, :3].T - room.planes[:, 3] - model.body.radius[:, None, None]
        if self_distances(model, ends)[0, apart].min(initial=np.inf) > 0 and heights.min(initial=np.inf) > 0:
            free.append(q)
        if len(free) == count:
            return np.array(free)
    raise ExperimentError(
        f"{model.description.name} is free of itself and the floor in too few postures: choose another workspace."
    )
