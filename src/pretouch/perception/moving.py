"""Fixtures that move: what units see of them is left out, and where the arm is nearest to them it keeps off."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, entry
from pretouch.groups import CapsuleArrays, Kinematics
from pretouch.moving_fixtures import MovingFixtures
from pretouch.perception.perceive import PerceptionSetup, perception_setup
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.robot.vectors import dot, placed_capsules
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, RangeReadings
from pretouch.values import real, real_number

_FARTHEST = 100.0
"""A coordinate [m] or a speed [m/s] from here on is implausible."""
_ON_AXIS = 1e-9
"""Distance between two axes below which there is no direction from one to the other [m]."""


def sound_moving(
    moving: MovingFixtures | None, now: float, longest: float
) -> tuple[MovingFixtures | None, str]:  # fmt: skip
    """Return moving fixtures as arrays of float64; None and what is wrong with those that cannot be used.

    Silence is no free space: what was somewhere longer than `longest` [s] ago may be anywhere by `now` [s].
    """
    if moving is None:
        return None, ""
    try:
        stamp, radius = real_number(moving.stamp), real(moving.radius)
        given = moving.a, moving.b, moving.a_velocity, moving.b_velocity
        a, b, a_velocity, b_velocity = map(real, given)
    except AttributeError:
        return None, f"are {moving!r}"
    except (TypeError, ValueError, OverflowError):
        return None, "are not arrays of numbers"
    count = len(radius) if radius.ndim == 1 else -1
    if count == 0:
        return None, ""
    if any(part.shape != (count, 3) for part in (a, b, a_velocity, b_velocity)):
        shapes = f"{a.shape}, {b.shape}, {a_velocity.shape}, {b_velocity.shape} and {radius.shape}"
        return None, f"have ends, velocities and radii of the shapes {shapes}"
    numbers = np.concatenate([part.ravel() for part in (a, b, a_velocity, b_velocity, radius)])
    if not (np.abs(numbers) < _FARTHEST).all() or (radius < 0.0).any():
        return None, f"hold a number that is none, is {_FARTHEST:g} or more, or a negative radius"
    if not abs(now - stamp) <= longest:
        return None, "have not been told of yet" if stamp == -np.inf else f"were last known {now - stamp:.3f} s ago"
    return MovingFixtures(stamp, a, b, radius, a_velocity, b_velocity), ""


def beside(setup: PerceptionSetup, moving: MovingFixtures, readings: RangeReadings, now: float) -> PerceptionSetup:
    """Return what is perceived with where these are fixtures too, at the newest of the readings' stamps."""
    stamps = readings.stamp[(readings.stamp <= now) & (readings.stamp >= now - setup.params.persistence_s)]
    a, b = moving.at(float(stamps.max(initial=-np.inf)) if len(stamps) else moving.stamp)
    still = setup.fixtures.capsules
    both = Capsules(
        np.concatenate([still.link, np.zeros(len(a), np.int64)]), np.concatenate([still.a, a]),
        np.concatenate([still.b, b]), np.concatenate([still.radius, moving.radius]),
    )  # fmt: skip
    return perception_setup(setup.model, setup.skin, replace(setup.fixtures, capsules=both), setup.params)


def near_moving(moving: MovingFixtures, model: RobotModel, kin: Kinematics, now: float, first: int) -> Obstacles:
    """Return where each link that moves is nearest to what moves beside it, one obstacle a link.

    Args:
        moving: with one capsule at least, as those that `sound_moving` returns.
        model: the arm.
        kin: its posture.
        now: instant of the step [s].
        first: index that stands for the first link in `Obstacles.unit`; those of the others follow.
    """
    (a, b), count = moving.at(now), len(model.parts)
    link, vectors, scalars = np.empty(count, WHOLE), np.empty((3, count, 3)), np.empty((2, count))
    _nearest.flat(
        *kin, *model.body.arrays, model.parts, a, b, moving.radius, moving.a_velocity, moving.b_velocity,
        link, vectors, scalars,
    )  # fmt: skip
    point, body_point, direction = vectors
    return Obstacles(
        unit=first + np.arange(count), point=point, ee_distance=np.full(count, np.inf), body_point=body_point,
        link=link, direction=direction, body_distance=scalars[0], closing_speed=scalars[1],
    )  # fmt: skip


class _Moving(NamedTuple):
    """As `MovingFixtures`, at one instant."""

    a: FloatArray
    b: FloatArray
    radius: FloatArray
    a_velocity: FloatArray
    b_velocity: FloatArray


class _Room(NamedTuple):
    """Room for what is nearest to each of P links."""

    link: IntArray
    """(P,)"""
    vectors: FloatArray
    """(3, P, 3) point, body point and direction."""
    scalars: FloatArray
    """(2, P) distance and closing speed."""


@entry
def _nearest(kin: Kinematics, body: CapsuleArrays, parts: IntArray, moving: _Moving, room: _Room) -> None:
    """Write where each link of `parts` (P,) is nearest to what moves."""
    link, own_a, own_b, own_radius = placed_capsules(body, kin)
    between, u, v = np.empty(3), np.empty(3), np.empty(3)
    for row in range(len(parts)):
        room.link[row], least = parts[row], np.inf
        for c in range(len(link)):
            if link[c] != parts[row]:
                continue
            for i in range(3):
                u[i] = own_b[c, i] - own_a[c, i]
            for m in range(len(moving.radius)):
                for i in range(3):
                    v[i], between[i] = moving.b[m, i] - moving.a[m, i], own_a[c, i] - moving.a[m, i]
                s, t = _closest(u, v, between)
                for i in range(3):
                    between[i] = t * v[i] - s * u[i] - between[i]  # from one axis to the other
                apart = np.sqrt(dot(between, between))
                gap = apart - own_radius[c] - moving.radius[m]
                if gap >= least:
                    continue
                least, speed = gap, 0.0
                for i in range(3):
                    # any direction will do where the axes meet
                    n = between[i] / apart if apart > _ON_AXIS else (1.0 if i == 2 else 0.0)
                    room.vectors[0, row, i] = moving.a[m, i] + t * v[i] - moving.radius[m] * n
                    room.vectors[1, row, i] = own_a[c, i] + s * u[i] + own_radius[c] * n
                    room.vectors[2, row, i] = n
                    speed -= n * (moving.a_velocity[m, i] + t * (moving.b_velocity[m, i] - moving.a_velocity[m, i]))
                room.scalars[0, row], room.scalars[1, row] = gap, speed


@compiled
def _closest(u: FloatArray, v: FloatArray, w: FloatArray) -> tuple[float, float]:
    """Where two segments of directions u and v (3,), w (3,) from the second's start to the first's, are nearest.

    Each from 0 to 1, as `robot.self_distance.nearest_points` has it.
    """
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    area = uu * vv - uv * uv
    s = _share(uv * vw - uw * vv, area if area > 1e-12 * uu * vv else 0.0)
    t = _share(uv * s + vw, vv)
    return _share(uv * t - uw, uu), t


@compiled
def _share(part: float, whole: float) -> float:
    """Quotient brought into 0 to 1; 0 where there is no whole."""
    return 0.0 if whole <= 0.0 else min(1.0, max(0.0, part / whole))
