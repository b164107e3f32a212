"""Rays into a simulated room, and what range finders make of them.

The geometry is MuJoCo's own, for geoms that a ray can meet at all.
A handful of rays from one place meets few of them. MuJoCo's function for many rays first finds, for each geom, between
which angles it is seen, which costs more than the rays.
"""

from typing import Any, NamedTuple

import mujoco
import numpy as np

from pretouch.compiled import compiled, entry, kernel
from pretouch.sim.flaws import ARRIVAL, NEXT, PART, PART_S, STAMP, FlawArrays, begin_frame, flawed, limits_of
from pretouch.sim.mujoco_calls import mju_rayGeom
from pretouch.types import BoolArray, FloatArray, IntArray, RangeStatus

_MARGIN_M2 = 1e-9
"""Rounding must not make a ray miss what it touches [m^2]."""


class Geoms(NamedTuple):
    """The visible geoms (G,) of a scene, in MuJoCo's memory."""

    visible: IntArray  # (V,) those that are visible
    kind: IntArray  # (G,) plane, sphere, capsule or box
    body: IntArray  # (G,)
    size: FloatArray  # (G, 3)
    reach: FloatArray  # (G,) radius of a ball round each [m]; 0 of a plane, which has none
    position: FloatArray  # (G, 3) centres [m], base frame
    rotation: FloatArray  # (G, 9) rows of the rotation matrices


def geoms_of(model: mujoco.MjModel, data: mujoco.MjData) -> Geoms:
    """Return what rays can meet in a simulation: all but transparent geoms."""
    own = model.geom_matid < 0
    alpha = np.where(own, model.geom_rgba[:, 3], 0.0)
    if not own.all():
        alpha[~own] = model.mat_rgba[model.geom_matid[~own], 3]
    shapes = np.flatnonzero(alpha), model.geom_type, model.geom_bodyid, model.geom_size, model.geom_rbound
    return Geoms(*shapes, data.geom_xpos, data.geom_xmat)


@kernel
def placed(xpos: FloatArray, xmat: FloatArray, T_link_sensor: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Origin (3,) [m] and rotation matrix (3, 3) of a sensor in the base frame.

    It sits at T_link_sensor (4, 4) on a body with the origin `xpos` (3,) [m] and the rotation matrix `xmat` (9,), rows.
    """
    origin, R = np.zeros(3), np.zeros((3, 3))
    for i in range(3):
        origin[i] = xpos[i]
        for k in range(3):
            origin[i] += xmat[3 * i + k] * T_link_sensor[k, 3]
            for j in range(3):
                R[i, j] += xmat[3 * i + k] * T_link_sensor[k, j]
    return origin, R


@kernel
def turned(R: FloatArray, cone: FloatArray) -> FloatArray:
    """Unit vectors (N, 3) of a cone in the frame that R (3, 3) brings them to."""
    rays = np.zeros_like(cone)
    for ray in range(len(cone)):
        for i in range(3):
            for j in range(3):
                rays[ray, i] += R[i, j] * cone[ray, j]
    return rays


@kernel
def _along(geoms: Geoms, geom: int, origin: FloatArray, ray: FloatArray, normal: FloatArray) -> float:
    """Return the distance [m] at which a ray meets a geom, -1 if it does not; into `normal` (3,) comes that there."""
    start, along, there = origin.ctypes.data, ray.ctypes.data, normal.ctypes.data
    position, rotation, size = geoms.position[geom], geoms.rotation[geom], geoms.size[geom]
    place, turn, shape = position.ctypes.data, rotation.ctypes.data, size.ctypes.data
    return mju_rayGeom(place, turn, shape, start, along, geoms.kind[geom], there)


@kernel
def cast(
    origin: FloatArray, rays: FloatArray, geoms: Geoms, without: int, farthest: float
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Distance (N,) [m] and outward normal (N, 3) where unit vectors (N, 3) from `origin` (3,) first meet something.

    And which geom (N,) that is. The distance is -1 where they meet nothing. Not met are geoms of the body `without` and
    those that are all farther than `farthest` [m].
    """
    nearest, normal, struck = np.full(len(rays), -1.0), np.zeros_like(rays), np.zeros(len(rays), np.int64)
    to, there = np.empty(3), np.empty(3)
    for geom in geoms.visible:
        if geoms.body[geom] == without:
            continue
        reach, bounded = geoms.reach[geom], geoms.reach[geom] > 0.0
        for i in range(3):
            to[i] = geoms.position[geom, i] - origin[i]
        away = to[0] * to[0] + to[1] * to[1] + to[2] * to[2]
        if bounded and away > (farthest + reach) ** 2 + _MARGIN_M2:
            continue
        for k in range(len(rays)):
            along = rays[k, 0] * to[0] + rays[k, 1] * to[1] + rays[k, 2] * to[2]
            # past its ball, or with it behind
            if bounded and away - (along * along if along > 0.0 else 0.0) > reach * reach + _MARGIN_M2:
                continue
            distance = _along(geoms, geom, origin, rays[k], there)
            if distance >= 0.0 and (distance < nearest[k] or nearest[k] < 0.0):
                nearest[k], struck[k] = distance, geom
                normal[k] = there
    return nearest, normal, struck


class Finders(NamedTuple):
    """Poses and links of K sensors, and the properties of each type."""

    position: FloatArray  # (L, 3) origins of the bodies [m], in MuJoCo's memory
    rotation: FloatArray  # (L, 9) rows of their rotation matrices
    link: IntArray  # (K,)
    T_link_sensor: FloatArray  # (K, 4, 4)
    cone: FloatArray  # (K, N, 3) unit vectors of the rays, sensor frame
    # (K, 5) constant error [m], factor that makes a flat wall read at its distance, farthest target [m], nearest [m],
    # times the noise of the VL53L1X
    figures: FloatArray


class Ranging(NamedTuple):
    """The K sensors of a skin of B units, when they measure, and what is on its way."""

    p: Any  # numbers of `RangeFinderParams`
    finders: Finders
    flaws: FlawArrays
    geoms: Geoms
    first: IntArray  # (B + 1,) first sensor of each unit, and K
    period: FloatArray  # (B,) [s]
    due: FloatArray  # (B,) when each measures next [s]
    silent: BoolArray  # (K,) whether each no longer sends
    sent: FloatArray  # (M, 8) sensor, when [s], arrival [s], distance [m], status, its deviation [m], strength, draw
    rows: IntArray  # (1,) how many of these rows there are
    whole: bool  # whether what never arrives is there, too: its arrival is infinite


_OK, _SIGMA, _SIGNAL, _MIN_RANGE = (
    int(s) for s in (RangeStatus.OK, RangeStatus.SIGMA, RangeStatus.SIGNAL, RangeStatus.MIN_RANGE)
)


@compiled
def measure(time: float, ranging: Ranging, rng: np.random.Generator) -> float:
    """Measure with the units that are due at an instant, and return when the next will be [s].

    There has to be room for a row of each sensor.
    """
    p, due, rows, flaws = ranging.p, ranging.due, ranging.rows, ranging.flaws
    finders, geoms = ranging.finders, ranging.geoms
    for unit in range(len(due)):
        if due[unit] > time:
            continue
        first, last = ranging.first[unit], ranging.first[unit + 1]
        own, part, period = flaws.course[unit], flaws.course[unit, PART], ranging.period[unit]
        if part == 0.0:
            own[NEXT] = due[unit] + period * (1.0 + p.period_jitter * rng.standard_normal())
        draws = np.empty(last - first)
        for i in range(len(draws)):
            draws[i] = rng.standard_normal()
        parts, until_stamp, delay, _ = flaws.of_unit[unit]
        if part == 0.0:
            own[STAMP] = time + until_stamp
            own[ARRIVAL] = own[STAMP] + delay + p.latency_s + rng.exponential(p.jitter_s)
            if rng.random() < p.dropout:
                own[ARRIVAL] = np.inf
            if flaws.kind[first] >= 0:
                begin_frame(unit, flaws.kind[first], period, flaws, rng)
        own[PART] = (part + 1.0) % parts
        due[unit] = own[NEXT] if own[PART] == 0.0 else due[unit] + PART_S
        for k in range(first, last):
            if flaws.part[k] == part and (ranging.whole or (own[ARRIVAL] < np.inf and not ranging.silent[k])):
                row = ranging.sent[rows[0]]
                rows[0] += 1
                row[0], row[1], row[7] = k, own[STAMP], draws[k - first]
                row[2] = np.inf if ranging.silent[k] else own[ARRIVAL]
                limits = p.noise_floor_m, p.noise_rate, finders.figures[k, 2], 1.0
                if flaws.kind[k] >= 0:
                    limits = limits_of(k, limits[2], flaws, rng)
                reading = _measured(k, row[7], limits, p, finders, geoms)
                if flaws.kind[k] >= 0:
                    reading = flawed(k, reading, p.reflectance, own, flaws, rng)
                row[3], row[4], row[5], row[6] = reading
    return due.min() if len(due) else np.inf


@entry
def deliver(
    now: float, sent: FloatArray, rows: IntArray, stamp: FloatArray, distance: FloatArray, status: IntArray
) -> None:
    """Bring what has arrived by now [s] to the newest readings (K,), and forget what never does."""
    left = 0
    for row in sent[: rows[0]]:
        if row[2] <= now:
            k = int(row[0])
            if row[1] > stamp[k]:
                stamp[k], distance[k], status[k] = row[1], row[3], int(row[4])
        elif row[2] < np.inf:
            sent[left] = row
            left += 1
    rows[0] = left


@kernel
def _measured(
    k: int, draw: float, limits: tuple[float, float, float, float], p: Any, finders: Finders, geoms: Geoms
) -> tuple[float, int, float, float]:
    """Measure with a sensor; `draw` is normal. Return distance [m], status, standard deviation [m], and strength.

    The limits are the noise at no distance [m], its growth, the distance of a grey target that is just seen [m], and
    the least strength that is.

    The nearest group of returns strong enough to be detected is reported. Strength falls with the square of the
    distance and the cosine of incidence. It is relative to a target that is just detected: one that fills the cone, at
    `distance_max`, square to the beam, of `reflectance_limit`, has 1 in all.
    """
    floor, rate, grey, least = limits
    link, figures = finders.link[k], finders.figures[k]
    offset, calibration, distance_max, nearest_m, noise = figures[0], figures[1], figures[2], figures[3], figures[4]
    origin, R = placed(finders.position[link], finders.rotation[link], finders.T_link_sensor[k])
    rays = turned(R, finders.cone[k])
    distance, normal, _ = cast(origin, rays, geoms, link, distance_max)
    brightness, count = p.reflectance / p.reflectance_limit, len(distance)
    strength = np.zeros(count)
    for i in range(count):
        if 0.0 <= distance[i] <= distance_max:
            # a ray that leaves a body began inside it: what presses on the sensor is at 0, not where the ray comes out
            outwards = rays[i, 0] * normal[i, 0] + rays[i, 1] * normal[i, 1] + rays[i, 2] * normal[i, 2]
            slant = abs(outwards)
            if outwards > 0:
                distance[i] = 0.0
            if p.slant_power != 1.0:
                slant = slant**p.slant_power
            ratio = grey / max(distance[i], 0.01)  # 10 mm: no return is infinitely strong
            strength[i] = brightness * slant * ratio * ratio / count
    total, mean = _nearest_group(distance, strength, p.merge_m, least)
    if total == 0.0:
        return 0.0, _SIGNAL, 0.0, sum(strength)
    mean *= calibration / total
    # shot noise: with a share of the light that a target filling the cone would return, 1 / sqrt(share) times the noise
    full = brightness * (grey / max(mean, 0.01)) ** 2
    sigma = floor + rate * mean * np.sqrt(max(1.0, full / total))
    trusted = sigma <= p.sigma_limit_m
    sigma *= noise
    measured = max(0.0, mean + offset + sigma * draw)
    if not trusted:
        return measured, _SIGMA, sigma, total
    return measured, _MIN_RANGE if measured < nearest_m else _OK, sigma, total


@kernel
def _nearest_group(distance: FloatArray, strength: FloatArray, merge_m: float, least: float) -> tuple[float, float]:
    """Strength of the nearest group of returns that is detected, and the sum of strength times distance; or zeros.

    A weak group hides nothing that is behind it.
    """
    start = 0.0
    while True:
        nearest = np.inf
        for i in range(len(distance)):
            if strength[i] > 0 and start <= distance[i] < nearest:
                nearest = distance[i]
        if nearest == np.inf:
            return 0.0, 0.0
        total, mean = 0.0, 0.0
        for i in range(len(distance)):
            if nearest <= distance[i] <= nearest + merge_m:
                total += strength[i]
                mean += strength[i] * distance[i]
        if total >= least:
            return total, mean
        start = nearest + merge_m
