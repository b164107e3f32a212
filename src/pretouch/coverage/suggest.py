"""Suggestion of more units: one after the other, each at the place that adds most to the coverage.

The coverage of a set of units grows with each unit, by less the more there are (it is submodular). So N units chosen
this way add at least 1 - 1/e, 63 %, of what the best N of the same places add (Nemhauser, Wolsey and Fisher 1978).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count as count_from

import numpy as np

from pretouch.coverage.ways import Ways, seen_by
from pretouch.errors import SkinError
from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import expected_range
from pretouch.robot.body import surface_of
from pretouch.robot.kinematics import tangents_of
from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import BoolArray, FloatArray

HEIGHT_M = 0.008
"""Height of a range finder above the surface [m]."""
_CLEAR_M = 0.4
"""Least free length of a place's beam in the ready posture [m]."""
_SPACING_M = 0.055
"""Distance between candidate places [m]; a Panda has about 300."""


@dataclass(frozen=True, eq=False)
class Suggestion:
    """A place for one more unit."""

    unit: SensorUnit
    gain: float
    """Increase of the whole arm's share, after the suggestions before it."""


@dataclass(frozen=True, eq=False)
class Suggestions:
    """Places for N more units, the best first."""

    chosen: tuple[Suggestion, ...]
    most: float
    """Bound on the increase of the share by as many of these places: the smaller of (1) the increase by the chosen ones
    over 1 - 1/e, (2) that increase and the largest gains that are left."""
    candidates: int

    @property
    def units(self) -> tuple[SensorUnit, ...]:
        """Suggested units."""
        return tuple(one.unit for one in self.chosen)


def candidates(ways: Ways, skin: Skin, sensor: Sensor = PAPER_SENSOR) -> tuple[SensorUnit, ...]:
    """Return units with a sensor all over the arm, with outward beams along the normal.

    In the ready posture, the beam of the paper's sensor is free there.
    """
    model = ways.model
    kin = model.kinematics(model.description.q_ready)
    at = surface_of(model.body, model.moved_by, kin, _SPACING_M)
    places = zip(at.link.tolist(), at.point, at.normal, strict=True)
    units = [
        SensorUnit(f"place {i}", model.links[link], _outward_pose(*rest)) for i, (link, *rest) in enumerate(places)
    ]
    units = [unit for unit in units if _fits(unit, model) and not _beside(unit, skin)]
    beams = Skin(units, model)
    of_no_link = placed_sensors(beams.arrays, kin)._replace(link=np.full(len(units), -1, np.int64))
    view = expected_range(kin, of_no_link, beams.cones, model.capsules, ways.room)
    return tuple(replace(units[i], sensor=sensor) for i in np.flatnonzero(view > _CLEAR_M))


def suggest(ways: Sequence[Ways], skin: Skin, count: int, places: tuple[SensorUnit, ...] | None = None) -> Suggestions:
    """Choose places for `count` more units, by one or more sets of ways with equal weights.

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
    order, gains, left = greedy(by_place, np.where(by_skin, 0.0, weight), count)
    free = (name for number in count_from(1) if (name := f"suggested_{number}") not in skin.boards)
    chosen = tuple(Suggestion(replace(places[i], id=next(free)), gain) for i, gain in zip(order, gains, strict=True))
    added = sum(gains)
    most = min(added + left, float(weight[~by_skin].sum()), added / (1 - 1 / np.e))
    return Suggestions(chosen, float(most), len(places))


def _visible(ways: Sequence[Ways], skin: Skin) -> BoolArray:
    """Return whether (B, W) each mounted unit sees the ball of each way of all sets and postures."""
    return np.hstack([seen_by(some, skin).reshape(len(skin.first), some.weight.size) for some in ways])


def greedy(sees: BoolArray, weight: FloatArray, count: int) -> tuple[list[int], list[float], float]:
    """Choose `count` of C sets (C, W) of weighted elements (W,), each time the set that adds most to those before.

    Returns:
        Their indices, the gain of each, and a bound on the gain of any other `count` after them. Sets without a gain
        are not chosen.
    """
    rest, order, gains = weight.copy(), list[int](), list[float]()
    gain = sees @ rest
    while len(order) < count and gain.max() > 0.0:
        best = int(gain.argmax())
        order.append(best)
        gains.append(float(gain[best]))
        rest[sees[best]] = 0.0
        gain = sees @ rest
    return order, gains, float(np.sort(gain)[-count:].sum())


def _outward_pose(point: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the pose (4, 4) of a unit above a surface point (3,) [m], its beam along the normal (3,); 10 um grid."""
    across, T = np.empty((2, 3)), np.eye(4)
    tangents_of(normal, across)
    T[:3, :3] = np.column_stack([across[0], across[1], normal])
    T[:3, 3] = np.round(point + HEIGHT_M * normal, 5)
    return T


def _fits(unit: SensorUnit, model: RobotModel) -> bool:
    try:
        Skin([unit], model)
    except SkinError:
        return False
    return True


def _beside(unit: SensorUnit, skin: Skin) -> bool:
    """Return whether another unit is at the same place: a board has about 3 cm."""
    p = unit.T_link_sensor[:3, 3]
    return any(
        other.link == unit.link and np.linalg.norm(other.T_link_sensor[:3, 3] - p) < 0.03 for other in skin.units
    )
