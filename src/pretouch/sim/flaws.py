"""How range finders err beside noise, by type, as recordings of real ones show it.

Zones: flights with a VL53L5CX of 8 x 8 zones, order closest, towards a panel, with motion capture (ETH,
github.com/ETH-PBL/Matrix_ToF_Drones), and frames of a VL53L8CX near a surface (github.com/JacksonJC034/VL53L8CX).
Cones: VL53L1X before a table (github.com/daniel-carlebach/vl53l1x_testing) and at four distances
(github.com/Sam-Belliveau/fast-robots). 4 x 4 zones, other types and their delays were never published: they err alike.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from pretouch.compiled import kernel
from pretouch.sensing.sensor import VL53L1X, VL53L5CX, VL53L7CX, Sensor
from pretouch.types import FloatArray, IntArray, RangeStatus

Reading = tuple[float, int, float, float]
"""Distance [m], status, standard deviation [m] and strength."""
ByDistance = tuple[tuple[float, float], ...]
"""Pairs: a distance [m], and what is there or up to there."""


class Flaws(NamedTuple):
    """Errors of a type."""

    noise: tuple[float, float]
    """Standard deviation at no distance [m], and its growth with distance [1]; both times the type's `noise`."""
    offset_max_m: float
    """Constant error of each sensor or zone, uniform up to this [m]."""
    behind_s: float
    """Time from the middle of a measurement to its reading [s]; where zones are measured in parts, of the last."""
    offset: ByDistance = ((0.0, 0.0),)
    """How much too far it reads [m], in proportion between these distances."""
    lost: ByDistance = ()
    """Share of readings up to each distance that say "no target", each zone for itself."""
    blind: ByDistance = ()
    """Share of frames up to each distance in bursts of "no target", which last for up to the type's `blind_s`."""
    wrong_m: float = 0.0
    """Distance below which numbers are wrong without an error [m]: by up to that too far, an assumption
    (piwars.abstracthorizon.org/posts/2019/02/10/vl53l1x_tof_sensor)."""
    seen_m: float = 0.0
    """Distance at which half of the readings of a wall of reflectance 0.5 are valid [m]; 0: all up to `grey_m`."""


# noise: 4 mm at 0.35 to 1 m, 8.5 mm at 2.2 m; bursts nearer than 0.2 m: as at 0.2 m, an assumption
_ZONES = Flaws(
    noise=(0.0015, 0.0012),
    offset_max_m=0.01,
    behind_s=0.059,
    offset=((0.0, 0.024), (0.05, 0.015), (0.1, 0.003), (0.15, -0.011)),
    lost=((0.35, 0.226), (0.5, 0.284), (0.7, 0.223), (1.0, 0.027), (1.3, 0.009)),
    blind=((0.35, 0.12), (0.5, 0.19), (0.7, 0.016)),
    seen_m=3.35,
)
FLAWS: dict[type[Sensor], Flaws] = {
    # noise: 1.1 to 2.2 mm in 100 ms, times the root of five; offset: -18 mm in one, 20 mm by the manual of STEBCN2V1
    VL53L1X: Flaws(noise=(0.0025, 0.001), offset_max_m=0.02, behind_s=VL53L1X.delay_s, wrong_m=0.04),
    VL53L7CX: _ZONES._replace(seen_m=3.35 * 3.5 / 4.0),  # UM3038: 3.5 m, where the VL53L5CX has 4
    VL53L5CX: _ZONES,
}
"""Types that have some; those made like them in skin files, too."""
SOFTNESS = 1 / 4.5
"""Spread of the least strength that is seen, log-logistic: 96, 87 and 53 % valid at 2.25, 2.75 and 3.3 m."""
GAP_S = 0.4
"""Scale of the gaps between frames with a target, exponential up to `blind_s` [s]: median 0.23, nine tenths below 0.63
(0.20 to 0.27, and 0.65)."""
STAYS = 0.15
"""Share of a burst's zones that go on, all of them at the rim: 3 to 16 of 64."""
PART_S = 1 / 60
"""Time from one part of 8 x 8 zones to the next [s]: they trail by 110, 94, 77 and 59 ms."""
_PARTS = np.array([[2, 1], [0, 3]])
"""Part that measures a zone, by row and column, even or odd."""
BLACK = 0.03
"""Reflectance up to which a reading is 22 to 27 mm with status OK, as before a black piano
(github.com/stm32duino/VL53L1X, issue 7)."""
_STEPS, _END_M = 100.0, 4.0
PART, NEXT, STAMP, ARRIVAL, _BLIND, _NEAREST = range(6)
_OK, _SIGNAL, _MIN_RANGE = int(RangeStatus.OK), int(RangeStatus.SIGNAL), int(RangeStatus.MIN_RANGE)


class FlawArrays(NamedTuple):
    """Flaws of K sensors of B units, of T types, for compiled code."""

    kind: IntArray  # (K,) type, -1: without flaws
    by_distance: FloatArray  # (T, 401, 3) for each cm: offset [m], share lost, bursts that begin in a second
    part: IntArray  # (K,) part of the frame that it is measured in
    # (K, 6) noise [m], its growth, distance of a grey wall just seen [m], spread of strength, below what distance it is
    # wrong [m], share of a burst that it sees
    of_sensor: FloatArray
    # (B, 4) parts of a frame, from the first to its stamp [s], from stamp to reading [s], longest burst [s]
    of_unit: FloatArray
    course: FloatArray  # (B, 6) part, next frame, stamp, arrival, end of the burst [s], nearest target [m]


def flaws_of(sensor: Sensor) -> Flaws | None:
    """Return what is known of a sensor's type."""
    return next((FLAWS[kind] for kind in type(sensor).__mro__ if kind in FLAWS), None)


def flaw_arrays(mounted: Sequence[Sensor], realistic: bool, reflectance_limit: float) -> FlawArrays:
    """Return the flaws of B mounted sensors, each with its zones; none if not `realistic`."""
    types = list(dict.fromkeys(s for s in mounted if realistic and flaws_of(s)))
    tables = np.array([_by_distance(sensor) for sensor in types]).reshape(-1, int(_STEPS * _END_M) + 1, 3)
    first = np.cumsum([0, *(sensor.zones**2 for sensor in mounted)])
    kind, part, of_sensor = np.full(first[-1], -1), np.zeros(first[-1], np.int64), np.zeros((first[-1], 6))
    of_unit, course = np.zeros((len(mounted), 4)), np.zeros((len(mounted), 6))
    of_unit[:, 0], course[:, _BLIND], course[:, _NEAREST] = 1.0, -np.inf, np.inf
    for unit, sensor in enumerate(mounted):
        own, n, flaws = slice(first[unit], first[unit + 1]), sensor.zones, flaws_of(sensor)
        if flaws is None or not realistic:
            continue
        row, column = np.divmod(np.arange(n * n), n)
        if parted := n == 8 and isinstance(sensor, VL53L5CX):
            part[own] = _PARTS[row % 2, column % 2]
        rim = (np.minimum(row, column) == 0) | (np.maximum(row, column) == n - 1)
        stays = np.where(rim, STAYS * n * n / rim.sum(), 0.0)
        grey = flaws.seen_m * np.sqrt(reflectance_limit / 0.5)
        usual = *flaws.noise, grey, SOFTNESS if grey else 0.0, flaws.wrong_m
        kind[own], of_sensor[own] = types.index(sensor), np.column_stack([np.tile(usual, (n * n, 1)), stays])
        blind_s, delay_s, _ = sensor.timing
        of_unit[unit] = 4 if parted else 1, 3 * PART_S * parted + flaws.behind_s - delay_s, delay_s, blind_s
    return FlawArrays(kind, tables, part, of_sensor, of_unit, course)


def _by_distance(sensor: Sensor) -> FloatArray:
    """Return the table (401, 3) of a type with flaws."""
    flaws, (blind_s, _, period) = flaws_of(sensor) or _ZONES, sensor.timing
    d = np.arange(int(_STEPS * _END_M) + 1) / _STEPS
    left = np.exp(-blind_s / GAP_S)
    mean = GAP_S - blind_s * left / (1.0 - left) - period / 2 if blind_s else np.inf
    (at, offset), blind = np.array(flaws.offset).T, _shares(flaws.blind, d)
    return np.column_stack([np.interp(d, at, offset), _shares(flaws.lost, d), blind / (1.0 - blind) / mean])


def _shares(pairs: ByDistance, d: FloatArray) -> FloatArray:
    ends, shares = np.array([*pairs, (np.inf, 0.0)]).T
    return shares[np.searchsorted(ends, d, "right")]


@kernel
def begin_frame(unit: int, kind: int, period: float, flaws: FlawArrays, rng: Generator) -> None:
    """Let a burst of "no target" begin, or not, as near as the nearest target of the frame before was."""
    own, longest = flaws.course[unit], flaws.of_unit[unit, 3]
    cell = int(_STEPS * min(own[_NEAREST], _END_M))
    own[_NEAREST] = np.inf
    if own[STAMP] < own[_BLIND] or not rng.random() < flaws.by_distance[kind, cell, 2] * period:
        return
    gap = -GAP_S * np.log(1.0 - rng.random() * (1.0 - np.exp(-longest / GAP_S)))
    own[_BLIND] = own[STAMP] + max(period / 2, gap - period)  # the gap ends with the first frame after it


@kernel
def limits_of(k: int, farthest: float, flaws: FlawArrays, rng: Generator) -> tuple[float, float, float, float]:
    """Return the noise at no distance [m], its growth, the distance of a grey target [m], and the least strength."""
    floor, rate, softness = flaws.of_sensor[k, 0], flaws.of_sensor[k, 1], flaws.of_sensor[k, 3]
    if softness == 0.0:
        return floor, rate, farthest, 1.0
    chance = rng.random()
    return floor, rate, flaws.of_sensor[k, 2], (chance / (1.0 - chance)) ** softness


@kernel
def flawed(k: int, reading: Reading, reflectance: float, own: FloatArray, flaws: FlawArrays, rng: Generator) -> Reading:
    """Return a reading of a sensor with the flaws of its type."""
    distance, status, sigma, strength = reading
    if reflectance <= BLACK and strength > 0.0:
        return 0.022 + 0.005 * rng.random(), _OK, sigma, strength
    if status != _OK and status != _MIN_RANGE:
        return reading
    own[_NEAREST] = min(own[_NEAREST], distance)
    here = flaws.by_distance[flaws.kind[k], int(_STEPS * min(distance, _END_M))]
    blind = own[STAMP] < own[_BLIND] and not rng.random() < flaws.of_sensor[k, 5]
    if blind or rng.random() < here[1]:
        return 0.0, _SIGNAL, 0.0, strength
    wrong = flaws.of_sensor[k, 4] * rng.random() if distance < flaws.of_sensor[k, 4] else 0.0
    return distance + here[0] + wrong, _OK, sigma, strength
