"""The postures that coverage is averaged over: on the paper's paths, or in the joints' whole range."""

from dataclasses import dataclass

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.importing.ready import ever_apart
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.body import placed
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to, capsule_ends, kinematics_of, self_distances
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.placement import placement_for
from pretouch.types import FloatArray

KINDS = ("circle", "line", "paths", "joints")
_DRAWN = 40
"""Postures drawn at most for each that is wanted: many meet the arm itself or the floor."""


@dataclass(frozen=True, eq=False)
class Postures:
    """S postures of a workspace."""

    q: FloatArray
    """(S, n) joint positions [rad]."""
    along: FloatArray | None = None
    """(S, 3) unit tangents of the hand's path, base frame; None where it has none."""


def postures(model: RobotModel, room: Fixtures, workspace: str, count: int, rng: np.random.Generator) -> Postures:
    """Draw `count` postures of a workspace.

    `circle` and `line` are the paper's, `paths` both, the hand upright; `joints` is the whole range of the joints,
    where the arm is clear of itself and of the room. Raises ExperimentError for anything else, and where the arm cannot
    be.
    """
    if count < 2:
        raise ExperimentError(f"The number of postures is {count}: give at least 2.")
    if workspace == "joints":
        return Postures(_anywhere(model, room, count, rng))
    if workspace not in KINDS:
        raise ExperimentError(f"The workspace is {workspace!r}: give {', '.join(KINDS)}.")
    place = placement_for(model)
    names = ("circle", "line") if workspace == "paths" else (workspace,)
    parts = np.array_split((np.arange(count) + rng.uniform(size=count)) / count, len(names))
    found = [_along(model, place, name, part * len(names) % 1.0) for name, part in zip(names, parts, strict=True)]
    return Postures(np.vstack([q for q, _ in found]), np.vstack([along for _, along in found]))


def _along(model: RobotModel, place: Placement, name: str, parts: FloatArray) -> tuple[FloatArray, FloatArray]:
    path = place.path(name, 1.0)
    phases = parts * path.length
    q = np.array([brought_to(model, path.point(phase)) for phase in phases])
    return q, np.array([path.tangent(phase) for phase in phases])


def _anywhere(model: RobotModel, room: Fixtures, count: int, rng: np.random.Generator) -> FloatArray:
    half = np.minimum((model.q_max - model.q_min) / 2, np.pi)
    apart, found = ever_apart(model), list[FloatArray]()
    for _ in range(_DRAWN * count):
        q = model.q_mid + half * rng.uniform(-1, 1, model.n)
        between = self_distances(model, capsule_ends(model, kinematics_of(model, q[None])))[0, apart]
        if between.min(initial=np.inf) > 0 and _above(model, room, q):
            found.append(q)
        if len(found) == count:
            return np.array(found)
    raise ExperimentError(
        f"{model.description.name} is free of itself and the floor in too few postures: choose another workspace."
    )


def _above(model: RobotModel, room: Fixtures, q: FloatArray) -> bool:
    """Whether the moving part of an arm is on the free side of all planes."""
    ends = np.stack(placed(model.body, model.kinematics(q))[1:3])
    heights = ends @ room.planes[:, :3].T - room.planes[:, 3]
    return bool(np.all(heights > model.body.radius[:, None]))
