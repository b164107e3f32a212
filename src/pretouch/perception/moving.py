"""Fixtures that move: what units see of them is left out, and where the arm is nearest to them it keeps off."""

from dataclasses import replace

import numpy as np

from pretouch.moving_fixtures import MovingFixtures
from pretouch.perception.perceive import PerceptionSetup, perception_setup
from pretouch.robot.body import Capsules
from pretouch.robot.model import Kinematics, RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.robot.vectors import placed
from pretouch.types import FloatArray, Obstacles, RangeReadings

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
        stamp, radius = float(moving.stamp), np.array(moving.radius, dtype=np.float64)
        given = moving.a, moving.b, moving.a_velocity, moving.b_velocity
        a, b, a_velocity, b_velocity = (np.array(part, dtype=np.float64) for part in given)
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
        return None, f"were last known {now - stamp:.3f} s ago"
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
    body, (own_a, own_b), (a, b) = model.body, placed(model.body, kin), moving.at(now)
    on_own, on_other = nearest_points(own_a[:, None], own_b[:, None], a[None], b[None])
    between = on_other - on_own
    apart = np.linalg.norm(between, axis=-1)
    gap = apart - body.radius[:, None] - moving.radius[None]
    # of each link the capsule that is nearest, and of each capsule the other that is
    other = gap.argmin(axis=1)
    least = gap[np.arange(len(gap)), other]
    own = np.array([np.flatnonzero(body.link == part)[least[body.link == part].argmin()] for part in model.parts])
    pair = own, other[own]
    length = apart[pair]
    up = np.array([0.0, 0.0, 1.0])  # any direction will do where the axes meet
    direction = np.where(length[:, None] > _ON_AXIS, between[pair] / np.maximum(length, _ON_AXIS)[:, None], up)
    point = on_other[pair] - moving.radius[pair[1], None] * direction
    speed = -(direction * _velocity(moving, a, b, on_other[pair], pair[1])).sum(axis=1)
    return Obstacles(
        unit=first + np.arange(len(own)), point=point, ee_distance=np.full(len(own), np.inf),
        body_point=on_own[pair] + body.radius[own, None] * direction, link=body.link[own], direction=direction,
        body_distance=gap[pair], closing_speed=speed,
    )  # fmt: skip


def _velocity(moving: MovingFixtures, a: FloatArray, b: FloatArray, point: FloatArray, which: FloatArray) -> FloatArray:
    """Velocities (M, 3) [m/s] of points (M, 3) on the axes of some of the capsules."""
    axis = (b - a)[which]
    length2 = (axis**2).sum(axis=1)
    along = ((point - a[which]) * axis).sum(axis=1) / np.where(length2 > 0.0, length2, 1.0)
    start, end = moving.a_velocity[which], moving.b_velocity[which]
    return np.asarray(start + along[:, None] * (end - start))
