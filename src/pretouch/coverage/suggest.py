"""Suggestion of more units: one after the other, each at the place that adds most to the coverage.

The coverage of a set of units grows with each unit, by less the more there are (it is submodular). So N units chosen
this way, one at a place, add at least half of what the best N add (Fisher, Nemhauser and Wolsey 1978).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count as count_from

import numpy as np

from pretouch.coverage.ways import Ways, expected_range, seen_by
from pretouch.errors import SkinError
from pretouch.perception.obstacles import placed_sensors
from pretouch.robot.body import surface_of
from pretouch.robot.kinematics import tangents_of
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, seat
from pretouch.types import BoolArray, FloatArray, IntArray

HEIGHT_M = 0.008
"""Height of a range finder above the surface [m]."""
_CLEAR_M = 0.4
"""Least free length of a place's beam in the ready posture [m]."""
_ASIDE = 0.5
"""Least sine of the angle between a normal and an axis of the hand for a beam tilted along it."""
_SPACING_M = 0.055
"""Distance between candidate places [m]; a Panda has about 300."""


@dataclass(frozen=True, eq=False)
class Suggestion:
    """A place for one more unit."""

    unit: SensorUnit
    gain: float
    """Increase of the whole arm's share, after the suggestions before it."""


def candidates(ways: Ways, skin: Skin, sensor: Sensor = PAPER_SENSOR) -> tuple[SensorUnit, ...]:
    """Return units with a sensor all over the arm, with outward beams along the normal.

    At the hand, what moves with the end-effector, there are also beams at 45 degrees from it, along each of the
    end-effector's axes and against it. In the ready posture, the beam of the paper's sensor is free there.
    """
    model = ways.model
    kin = model.kinematics(model.description.q_ready)
    at = surface_of(model.body, model.moved_by, kin, _SPACING_M)
    units, hand = list[SensorUnit](), model.rigid == model.rigid[model.ee]
    for i, (link, point, normal) in enumerate(zip(at.link.tolist(), at.point, at.normal, strict=True)):
        axes = (kin.rotation[link].T @ kin.rotation[model.ee]).T if hand[link] else ()
        beams = [normal, *(beam for axis in axes for beam in _tilted(normal, axis))]
        poses = [_outward_pose(point, normal, beam) for beam in beams]
        if (below := seat(model, link, poses[0][:3, 3])) and below.height >= 0:  # not inside another capsule
            units += [SensorUnit(f"place {i}.{k}", model.links[link], pose) for k, pose in enumerate(poses)]
    units = [unit for unit in units if not _beside(unit, skin)]
    worn = Skin(units, model)
    of_no_link = placed_sensors(worn.arrays, kin)._replace(link=np.full(len(units), -1, np.int64))
    view = expected_range(kin, of_no_link, worn.cones, model.capsules, ways.room)
    return tuple(replace(units[i], sensor=sensor) for i in np.flatnonzero(view > _CLEAR_M))


def suggest(
    ways: Sequence[Ways], skin: Skin, count: int, places: tuple[SensorUnit, ...] | None = None
) -> tuple[Suggestion, ...]:
    """Return places for `count` more units, the best first, by one or more sets of ways with equal weights.

    Raises SkinError for more units than there are places.
    """
    places = candidates(ways[0], skin) if places is None else places
    if not 1 <= count <= len(places):
        raise SkinError(
            f"{count} more units were requested, but {len(places)} positions were found: request 1 to {len(places)}."
        )
    weight = np.concatenate([some.share.ravel() for some in ways]) / len(ways)
    by_skin = _visible(ways, skin).any(axis=0)
    # each place alone: together they may be more zones than a skin has
    by_place = np.concatenate([_visible(ways, Skin([place], ways[0].model)) for place in places])
    at = [(ways[0].model.link_index(place.link), *place.T_link_sensor[:3, 3]) for place in places]
    spot = np.unique(at, axis=0, return_inverse=True)[1].ravel()
    chosen = greedy(by_place, np.where(by_skin, 0.0, weight), count, spot)
    free = (name for number in count_from(1) if (name := f"suggested_{number}") not in skin.boards)
    return tuple(Suggestion(replace(places[i], id=next(free)), gain) for i, gain in chosen)


def _visible(ways: Sequence[Ways], skin: Skin) -> BoolArray:
    """Return whether (B, W) each mounted unit sees the ball of each way of all sets and postures."""
    return np.hstack([seen_by(some, skin).reshape(len(skin.first), some.weight.size) for some in ways])


def greedy(sees: BoolArray, weight: FloatArray, count: int, group: IntArray) -> list[tuple[int, float]]:
    """Choose `count` of C sets (C, W) of weighted elements (W,), each time the set that adds most to those before.

    At most one of each `group` (C,) is chosen, and none without a gain. Returns indices and gains.
    """
    rest, free, chosen = weight.copy(), np.ones(len(sees), np.bool_), list[tuple[int, float]]()
    while len(chosen) < count and (gain := np.where(free, sees @ rest, 0.0)).max() > 0.0:
        best = int(gain.argmax())
        chosen.append((best, float(gain[best])))
        rest[sees[best]] = 0.0
        free &= group != group[best]
    return chosen


def _tilted(normal: FloatArray, axis: FloatArray) -> list[FloatArray]:
    """Return unit vectors at 45 degrees from a normal (3,), along an axis (3,) and against it; none if both agree."""
    aside = axis - (axis @ normal) * normal
    length = float(np.linalg.norm(aside))
    return [(normal + sign * aside / length) / np.sqrt(2.0) for sign in (1.0, -1.0)] if length > _ASIDE else []


def _outward_pose(point: FloatArray, normal: FloatArray, beam: FloatArray) -> FloatArray:
    """Return the pose (4, 4) of a unit above a surface point (3,) [m] with a normal (3,); 10 um grid."""
    across, T = np.empty((2, 3)), np.eye(4)
    tangents_of(beam, across)
    T[:3, :3] = np.column_stack([across[0], across[1], beam])
    T[:3, 3] = np.round(point + HEIGHT_M * normal, 5)
    return T


def _beside(unit: SensorUnit, skin: Skin) -> bool:
    """Return whether another unit is at the same place: a board has about 3 cm."""
    p = unit.T_link_sensor[:3, 3]
    return any(
        other.link == unit.link and np.linalg.norm(other.T_link_sensor[:3, 3] - p) < 0.03 for other in skin.units
    )
