"""Places for sensor units: on the surface of each moving link, facing outwards, clear of the arm's own body."""

from dataclasses import dataclass

import numpy as np

from pretouch.errors import SkinError
from pretouch.importing.sampling import spread
from pretouch.importing.surface_distance import SurfaceDistance
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, cone_rays
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import FloatArray

HEIGHT = 0.008
"""Of a unit above its link's capsules and surface, at least [m]: a board in its case."""
ROUND_HAND = 4
"""Units round the outermost link that has room, as round the hand in the paper; the other links have one each."""
_SMALLEST = 0.02
"""Radius of a capsule on which a unit still has room [m]."""
_ALONG = (0.5, 0.25, 0.75)
_AROUND = 12
_POSTURES, _SPREAD = 8, 0.6
"""Postures about the ready one in which the beams are to be free, and how far about [rad]."""
_APART = 0.03
"""Least distance of two units on a link [m]."""
_RAISES = 20
"""Steps in which a unit is moved out of the surface."""
_RANGE = 1.0
"""How far the beams are followed [m]."""
_FREE = 0.8
"""Least part of the beams that has to be free."""


def proposed_skin(model: RobotModel, surfaces: dict[str, SurfaceDistance]) -> tuple[Skin, tuple[str, ...]]:
    """Return units on each moving link that has room, and a sentence for the links that have none.

    Args:
        model: the arm, in its ready posture.
        surfaces: by the name of the link, in its frame.
    """
    postures = _postures(model)
    units: list[SensorUnit] = []
    beams: list[FloatArray] = []
    bare = []
    wanted = ROUND_HAND
    for link in _outermost_first(model):
        places = _free_places(model, link, postures, surfaces[model.links[link]])
        own: list[FloatArray] = []
        while places and len(own) < wanted:
            T = max(places, key=lambda place: _worth(place, postures[0].rotation[link], own, beams)).T
            suffix = f"_{len(own) + 1}" if wanted > 1 else ""
            units.append(SensorUnit(f"on_{model.links[link]}{suffix}", model.links[link], T))
            own.append(postures[0].rotation[link] @ T[:3, 2])
            places = [place for place in places if np.linalg.norm(place.T[:3, 3] - T[:3, 3]) > _APART]
        beams += own
        if own:
            wanted = 1
        else:
            bare.append(model.links[link])
    remarks = (f"Without space for a unit that sees past the arm: {', '.join(bare)}.",) if bare else ()
    return Skin(units, model), remarks


def _outermost_first(model: RobotModel) -> list[int]:
    """Moving links with capsules: those that more joints move first, of such the larger ones."""
    body = model.body
    size = body.radius**2 * (np.linalg.norm(body.b - body.a, axis=1) + body.radius)
    links = np.unique(body.link).tolist()
    return sorted(links, key=lambda link: (-model.moved_by[link].sum(), -size[body.link == link].sum(), link))


def _postures(model: RobotModel) -> list[Kinematics]:
    """Return the ready posture, and some about it."""
    ready = model.description.q_ready
    around = ready + _SPREAD * (2 * spread(_POSTURES, model.n) - 1)
    return [model.kinematics(np.clip(q, model.q_min, model.q_max)) for q in [ready, *around]]


@dataclass(frozen=True, eq=False)
class _Place:
    """A pose on a link, and how much of what a unit would see there is free."""

    T: FloatArray
    """(4, 4) link frame."""
    free: float
    """Part of the beams, over all postures."""


def _free_places(model: RobotModel, link: int, postures: list[Kinematics], surface: SurfaceDistance) -> list[_Place]:
    """Return the places on a link that are outside its capsules and surface and see past the rest of the arm."""
    found = []
    for on_capsule in _places(model.capsules.of_links(np.array([link]))):
        T = _raised(on_capsule, surface)
        if T is None:
            continue
        try:
            Skin([SensorUnit("unit", model.links[link], T)], model)
        except SkinError:  # inside another capsule of the link
            continue
        if _free(model, postures[0], link, T) < _FREE:
            continue
        free = float(np.mean([_free(model, kin, link, T) for kin in postures]))
        if free >= _FREE:
            found.append(_Place(T, free))
    return found


def _raised(T: FloatArray, surface: SurfaceDistance) -> FloatArray | None:
    """Move a unit (4, 4) outwards until it is `HEIGHT` above a surface; None if that takes too many steps."""
    raised = T.copy()
    for _ in range(_RAISES):
        at = raised[None, :3, 3]
        height = float(surface(at)[0]) * (1 if surface.outside(at)[0] else -1)
        if height >= HEIGHT - 1e-6:
            return raised
        raised[:3, 3] += (HEIGHT - height) * T[:3, 2]
    return None


def _worth(place: _Place, rotation: FloatArray, own: list[FloatArray], beams: list[FloatArray]) -> float:
    """Say how good a place is: free, and looking where no unit of this link (`own`) or another looks yet.

    Level beams see people, those up and down the ceiling and the floor.
    """
    beam = rotation @ place.T[:3, 2]
    return place.free - 0.5 * _seen(beam, own) - 0.2 * _seen(beam, beams) - 0.6 * abs(float(beam[2]))


def _seen(beam: FloatArray, others: list[FloatArray]) -> float:
    """Cosine between a beam and the nearest other one; -1 if there is none."""
    return max((float(beam @ other) for other in others), default=-1.0)


def _places(capsules: Capsules) -> list[FloatArray]:
    """Poses (4, 4) on the sides and both ends of a link's capsules, z outwards, link frame."""
    found = []
    for a, b, radius in zip(capsules.a, capsules.b, capsules.radius, strict=True):
        if radius < _SMALLEST:
            continue
        along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-12)
        across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        across /= np.linalg.norm(across)
        for part in _ALONG:
            for turn in 2 * np.pi * np.arange(_AROUND) / _AROUND:
                z = np.cos(turn) * across + np.sin(turn) * np.cross(along, across)
                found.append(_pose(a + part * (b - a), radius, along, z))
        found += [_pose(a, radius, across, -along), _pose(b, radius, across, along)]
    return found


def _pose(foot: FloatArray, radius: float, x: FloatArray, z: FloatArray) -> FloatArray:
    """Pose (4, 4) of a unit over a point (3,) of a capsule's axis."""
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    T[:3, 3] = foot + (radius + HEIGHT) * z
    return T


def _free(model: RobotModel, kin: Kinematics, link: int, T: FloatArray) -> float:
    """Part of a unit's beams that no other link of the arm is in, in one posture."""
    others = model.capsules.of_links(np.flatnonzero(np.arange(len(model.links)) != link))
    rays = cone_rays(1, PAPER_SENSOR.angle) @ (kin.rotation[link] @ T[:3, :3]).T
    start = kin.position[link] + kin.rotation[link] @ T[:3, 3]
    along = np.linspace(0.0, _RANGE, 26)[1:]
    points = (start + along[:, None, None] * rays).reshape(-1, 3)
    a = kin.position[others.link] + np.einsum("kij,kj->ki", kin.rotation[others.link], others.a)
    b = kin.position[others.link] + np.einsum("kij,kj->ki", kin.rotation[others.link], others.b)
    axis = b - a
    part = np.einsum("pki,ki->pk", points[:, None] - a, axis) / np.maximum(np.einsum("ki,ki->k", axis, axis), 1e-18)
    away = points[:, None] - a - np.clip(part, 0.0, 1.0)[..., None] * axis
    hit = (np.linalg.norm(away, axis=2) < others.radius).any(axis=1).reshape(len(along), len(rays)).any(axis=0)
    return 1.0 - float(hit.mean())
