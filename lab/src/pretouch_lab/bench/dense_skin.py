"""Units spread over the arm. Most scenarios use 32 of them, stored as `scenarios/dense_skin.toml`."""

from itertools import product

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.robot.body import from_axes, placed
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import FloatArray

UNITS = {"link2": 3, "link3": 5, "link4": 5, "link5": 7, "link6": 4, "link7": 2, "hand": 6}
"""Units on each link of a skin of 32."""
_FIRST = tuple(reversed(UNITS))
"""Links in the order in which each gets its first unit: those likeliest to touch something first."""
_HEIGHT_M = 0.008
"""Height of a range finder above the surface [m]."""
_CLEAR_M = (0.05, 0.1, 0.2, 0.3)
"""Distances along a beam [m] that must lie outside the rest of the arm, in the ready posture."""
_TURNS, _PARTS = 2 * np.pi * np.arange(24) / 24, np.linspace(0.0, 1.0, 7)
"""Candidate places on a capsule: angles round its axis [rad], and fractions of its length."""


def surface(a: FloatArray, b: FloatArray, turn: float, part: float) -> tuple[FloatArray, FloatArray]:
    """Return the foot on a capsule's axis, `part` of the way from a to b (3,) [m], and a unit normal at an angle."""
    along = (b - a) / np.linalg.norm(b - a)
    aside = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    aside /= np.linalg.norm(aside)
    return a + part * (b - a), np.cos(turn) * aside + np.sin(turn) * np.cross(along, aside)


def gap(points: FloatArray, a: FloatArray, b: FloatArray, radius: FloatArray) -> FloatArray:
    """Signed distance (P,) [m] of points (P, 3) from the nearest of C capsules (C, 3), (C, 3), (C,)."""
    return np.asarray((np.linalg.norm(from_axes(points, a, b)[1], axis=2) - radius).min(axis=1))


def units_of(count: int) -> dict[str, int]:
    """Return the number of units on each link of `count` units: first one on each, then in proportion to `UNITS`.

    A larger skin contains every smaller one. Shares are Webster's: the next unit goes to the link with the largest
    UNITS / (2 n + 1), where n is its number of units, so that 32 units are `UNITS`.
    """
    counts = dict.fromkeys(UNITS, 0)
    for number in range(count):
        most = max(_FIRST, key=lambda name: UNITS[name] / (2 * counts[name] + 1))
        counts[_FIRST[number] if number < len(_FIRST) else most] += 1
    return counts


def spread_skin(model: RobotModel, count: int) -> Skin:
    """Spread units over the links of a Panda, as far apart on each link as possible, each facing away from the arm.

    Raises ExperimentError for less than one unit, and for more units than places.
    """
    if count < 1:
        raise ExperimentError(f"The number of units is {count}: give at least 1, or a profile without proximity.")
    units = []
    for name, number_there in units_of(count).items():
        link = model.link_index(f"{model.description.name}_{name}")
        places, normals = _candidates(model, link)
        if number_there > len(places):
            raise ExperimentError(
                f"{number_there} of {count} units belong on {name}, which has {len(places)} places: give fewer units."
            )
        chosen = [int(np.argmax(places[:, 2]))]
        while len(chosen) < number_there:  # the place farthest from the chosen ones
            chosen.append(int(np.argmax(np.linalg.norm(places[:, None] - places[chosen], axis=2).min(axis=1))))
        for number, i in enumerate(chosen[:number_there]):
            z, T = normals[i], np.eye(4)
            x = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
            x /= np.linalg.norm(x)
            T[:3, :3], T[:3, 3] = np.column_stack([x, np.cross(z, x), z]), np.round(places[i], 5)
            units.append(SensorUnit(f"{name}_{number + 1}", model.links[link], T))
    return Skin(units, model)


def _candidates(model: RobotModel, link: int) -> tuple[FloatArray, FloatArray]:
    """Places (P, 3) [m] and normals (P, 3) on a link, link frame, whose beams leave the arm in the ready posture."""
    kin, arm = model.kinematics(model.description.q_ready), model.capsules
    _, a, b, _ = placed(arm, kin)
    places, normals = [], []
    for c, turn, part in product(np.flatnonzero(arm.link == link), _TURNS, _PARTS):
        foot, normal = surface(arm.a[c], arm.b[c], turn, part)
        place = foot + (arm.radius[c] + _HEIGHT_M) * normal
        ahead = place + np.outer((0.0, *_CLEAR_M), normal)
        free = gap(ahead @ kin.rotation[link].T + kin.position[link], a, b, arm.radius)
        if free[0] > 0.9 * _HEIGHT_M and free[1:].min() > 0.02:
            places.append(place)
            normals.append(normal)
    return np.array(places), np.array(normals)
