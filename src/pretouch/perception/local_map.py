"""Places near the arm that were seen occupied, until they are seen empty or are too old.

A reading says that something is at its distance, and that nothing is nearer along its beam: the first is remembered as
a place, the second removes places. A place stands for a ball behind the surface that was seen, as large as a fist. It
lasts from the second look on. Each cell has one place; a narrow look has smaller cells, and replaces wide ones.
"""

import math
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import inlined, kernel
from pretouch.params import LocalMapParams
from pretouch.perception.closest import closest
from pretouch.perception.obstacles import FASTEST
from pretouch.records import IntCell, zeros
from pretouch.robot.body import Capsules
from pretouch.robot.kinematics import dot, separation
from pretouch.sensing.sensor import Sensors
from pretouch.sensing.skin import SkinArrays
from pretouch.types import FloatArray, IntArray, Obstacles, no_obstacles, some_of

MOST_PLACES = 512
"""Places that the map has room for; then the oldest go."""
_WIDE_M = 0.03
"""Half a footprint [m] up to which a look has the smallest cells; up to twice that they are twice as large."""
_APART = math.cos(math.radians(30.0))
"""Largest cosine between the directions of two obstacles of one link."""
_MOVING_S = 0.15
"""Time after a look for which its object goes on with its speed [s]."""


class LocalMap(NamedTuple):
    """Remembered places, the first `number` of N. Base frame."""

    number: IntCell
    place: Annotated[FloatArray, "N", 3]
    """(N, 3) centres of balls; of outside points, the points themselves [m]."""
    velocity: Annotated[FloatArray, "N", 3]
    """(N, 3) of the object at the last look [m/s]."""
    stamp: Annotated[FloatArray, "N"]
    """(N,) stamp of the last look that showed it [s]."""
    until: Annotated[FloatArray, "N"]
    """(N,) instant until which it is remembered [s]."""
    width: Annotated[FloatArray, "N"]
    """(N,) half the width of the look's footprint [m]."""
    spread: Annotated[FloatArray, "N"]
    """(N,) uncertainty of the place [m]."""
    cell: Annotated[IntArray, "N"]
    """(N,) its cell, see `cell_number`."""
    looks: Annotated[IntArray, "N"]
    """(N,) looks that count for it."""
    empty_since: Annotated[FloatArray, "N"]
    """(N,) stamp of the first look after that which saw it empty, infinite without one [s]."""
    unit: Annotated[IntArray, "N"]
    """(N,) index of the unit that saw it last; -1: outside sources."""


def map_init(room: int) -> LocalMap:
    """Return a map without places, with room for a number of them."""
    return zeros(LocalMap, N=room)


class Look(NamedTuple):
    """One reading as it shows one place."""

    stamp: float
    """[s]"""
    lasts: tuple[float, float]
    """Life of a place after one look, and after several [s]."""
    width: float
    """Half the width of the footprint [m]."""
    spread: float
    """Uncertainty of the place [m]."""
    unit: int
    """See `LocalMap.unit`."""


@kernel
def cell_number(at: FloatArray, width: float, smallest: float, outside: bool) -> int:
    """Return a number for the cell around a point (3,) [m], of a look with half a footprint `width` [m].

    Outside sources have cells of their own: what they no longer show, units may still remember.
    """
    level = 0 if width < _WIDE_M else 1 if width < 2.0 * _WIDE_M else 2
    number = 2 * level + (1 if outside else 0)
    for i in range(3):
        number = (number << 20) + (math.floor(at[i] / (smallest * (1 << level))) & 0xFFFFF)
    return number


@kernel
def remember(places: LocalMap, at: FloatArray, velocity: FloatArray, look: Look, p: LocalMapParams) -> None:
    """Add a look at a place (3,) [m] of an object with a velocity (3,) [m/s]."""
    cell, m = cell_number(at, look.width, p.cell_m, look.unit < 0), 0
    while m < places.number[0] and places.cell[m] != cell:
        m += 1
    if m == places.number[0]:
        if m == len(places.stamp):
            oldest = places.stamp.argmin()
            if places.stamp[oldest] < look.stamp:  # it goes, and the next look finds room
                places.looks[oldest], places.stamp[oldest] = 0, np.inf
            return
        places.number[0] += 1
        places.cell[m], places.looks[m], places.stamp[m], places.width[m] = cell, 0, -np.inf, look.width
    if not (look.stamp > places.stamp[m] or look.width < places.width[m]):
        return
    if look.stamp > places.stamp[m]:
        places.looks[m] = min(p.looks, places.looks[m] + 1)
    places.stamp[m], places.width[m], places.spread[m] = look.stamp, look.width, look.spread
    places.until[m], places.unit[m] = look.stamp + look.lasts[min(places.looks[m], 2) - 1], look.unit
    places.empty_since[m] = np.inf
    for i in range(3):
        places.place[m, i], places.velocity[m, i] = at[i], velocity[i]


@kernel
def replace_wider(places: LocalMap, at: FloatArray, stamp: float, width: float) -> None:
    """Take a look off each place near `at` (3,) [m] that a clearly wider look saw earlier: it was seen here now."""
    for m in range(places.number[0]):
        wider = places.width[m] > 1.5 * width + 0.01 and places.stamp[m] < stamp
        if wider and separation(places.place, m, at) < min(places.width[m], 0.1) + _WIDE_M:
            places.looks[m] = max(0, places.looks[m] - 1)


@kernel
def height_over(places: LocalMap, position: FloatArray, beam: FloatArray, reach: float, look: Look) -> float:
    """Return the least height [m] along a beam (3,) of the places within `reach` [m] ahead of a sensor, else `reach`.

    A sensor at `position` (3,) [m] that only tells that something is nearer than it measures may show any of these:
    they are seen.
    """
    least, to = reach, np.empty(3)
    for m in range(places.number[0]):
        for i in range(3):
            to[i] = places.place[m, i] - position[i]
        if places.looks[m] > 0 and dot(to, to) < reach * reach and dot(to, beam) > 0.0:
            least = min(least, dot(to, beam))
            places.stamp[m], places.empty_since[m] = max(places.stamp[m], look.stamp), np.inf
            places.until[m] = max(places.until[m], look.stamp + look.lasts[1])
    return least


@inlined
def carve(
    places: LocalMap, sensors: Sensors, skin: SkinArrays, looks: tuple[FloatArray, FloatArray, FloatArray], most: float
) -> None:
    """Take a look off each place that a unit sees empty after it was last seen.

    Each place is looked up in the zone that looks at it. `looks` are the stamp of each zone's (K,) [s], the distance
    (K,) [m] up to which nothing is along its beam, -inf where nothing is told, and the time (K,) [s] for which a place
    must be seen so before that counts; places beyond `most` [m] stay.
    """
    (position, rotation, _), (stamp, end, wait), first, to = sensors, looks, skin.first, np.empty(3)
    for b in range(len(first) - 1):
        k0, k1, farthest = first[b], first[b + 1], first[b]
        for k in range(k0, k1):
            farthest = k if end[k] > end[farthest] else farthest
        # a single cone misses at its edge what fills little of it: half of the cone sees a place empty
        edge = skin.cones.edge[skin.cones.kind[k0], 0]
        inside = edge if k1 - k0 > 1 else math.sqrt((1.0 + edge) / 2.0)
        for m in range(places.number[0]):
            away = separation(places.place, m, position[farthest])
            if not away < min(end[farthest], most):
                continue
            for i in range(3):
                to[i] = places.place[m, i] - position[farthest, i]
            best, at = -np.inf, k0
            for k in range(k0, k1):
                along = to[0] * rotation[k, 0, 2] + to[1] * rotation[k, 1, 2] + to[2] * rotation[k, 2, 2]
                if along > best:
                    best, at = along, k
            if away < end[at] and best > inside * away and places.stamp[m] < stamp[at]:
                places.empty_since[m] = min(places.empty_since[m], stamp[at])
                if stamp[at] - places.empty_since[m] >= wait[at]:
                    places.looks[m] = max(0, places.looks[m] - 1)


@kernel
def forget(places: LocalMap, now: float) -> None:
    """Remove the places that are too old, or that were seen empty."""
    m = 0
    while m < places.number[0]:
        if places.looks[m] > 0 and now <= places.until[m]:
            m += 1
            continue
        last = places.number[0] - 1
        for i in range(3):
            places.place[m, i], places.velocity[m, i] = places.place[last, i], places.velocity[last, i]
        places.stamp[m], places.until[m], places.looks[m] = places.stamp[last], places.until[last], places.looks[last]
        places.width[m], places.spread[m], places.unit[m] = places.width[last], places.spread[last], places.unit[last]
        places.empty_since[m], places.cell[m] = places.empty_since[last], places.cell[last]
        places.number[0] = last


@inlined
def nearest_places(
    places: LocalMap, arm: tuple[Capsules, IntArray, FloatArray], now: float, p: LocalMapParams,
    outside: tuple[int, float, tuple[float, float]], room: Obstacles,
) -> int:  # fmt: skip
    """Write the obstacles: of each moving link the nearest place, then the nearest one in another direction, and so on.

    Args:
        places: remembered; where the arm itself comes to be, nothing is.
        arm: placed capsules that joints move, the number (L,) of each link among those, and the end-effector origin
            (3,) [m].
        now: instant of the step [s].
        p: parameters.
        outside: of outside points: `Obstacles.unit`, the distance from the body up to which no source can show one
            [m], and their lives elsewhere and there [s].
        room: for the obstacles.

    Returns the number of obstacles.
    """
    forget(places, now)
    count, (units, hidden_m, lives), (body, part, ee) = places.number[0], outside, arm
    near, candidates, some = no_obstacles(count), np.empty(count, np.int64), 0
    near.point[:] = places.place[:count]
    near.direction[:, 2] = 1.0
    closest(body, near)
    distance = near.body_distance
    for m in range(count):
        if distance[m] < 0.0:
            places.looks[m] = 0
            continue
        distance[m] -= places.spread[m]
        if places.unit[m] >= 0:
            distance[m] -= p.fist_m
        elif distance[m] <= hidden_m:
            places.until[m] = max(places.until[m], min(now + lives[0], places.stamp[m] + lives[1]))
        if distance[m] < p.mark_m:
            candidates[some] = m
            some += 1
    chosen = np.full((part.max() + 1) * p.per_link, -1, np.int64)
    for rank in range(p.per_link):
        for m in candidates[:some]:
            first = part[near.link[m]] * p.per_link
            best = chosen[first + rank]
            if best >= 0 and not distance[m] < distance[best]:
                continue
            if _is_apart(near.direction, m, chosen[first : first + rank]):
                chosen[first + rank] = m
    obstacles = 0
    for slot in range(len(chosen)):
        m = chosen[slot]
        if m >= 0:
            radius = p.fist_m if places.unit[m] >= 0 else 0.0
            _write(places, near, m, now, radius, some_of(room, obstacles, obstacles + 1))
            room.unit[obstacles] = places.unit[m] if places.unit[m] >= 0 else units
            room.ee_distance[obstacles] = max(0.0, separation(room.point, obstacles, ee) - places.spread[m])
            room.slot[obstacles] = slot
            obstacles += 1
    return obstacles


@kernel
def _write(places: LocalMap, near: Obstacles, m: int, now: float, radius: float, room: Obstacles) -> None:
    """Write place m, a ball of a radius [m], as the obstacle."""
    room.link[0], room.body_distance[0] = near.link[m], near.body_distance[m]
    room.age[0], speed = now - places.stamp[m], 0.0
    for i in range(3):
        room.point[0, i] = near.point[m, i] - radius * near.direction[m, i]
        room.body_point[0, i], room.direction[0, i] = near.body_point[m, i], near.direction[m, i]
        speed -= places.velocity[m, i] * near.direction[m, i]  # -v . u, u from the body to the object
    # never faster than a person's hand
    room.closing_speed[0] = min(max(speed, -FASTEST), FASTEST) if room.age[0] <= _MOVING_S else 0.0


@kernel
def _is_apart(direction: FloatArray, m: int, chosen: IntArray) -> bool:
    """Return whether place m has another direction from its link than all those chosen; false if one is missing."""
    for c in chosen:  # noqa: SIM110  compiled code knows no generators
        if c < 0 or c == m or dot(direction[c], direction[m]) > _APART:
            return False
    return True
