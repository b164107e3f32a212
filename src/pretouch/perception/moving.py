"""Fixtures that move: what units see of them is left out, and where the arm is nearest to them it keeps off."""

import numpy as np

from pretouch.groups import CapsuleArrays, Kinematics
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import nearest_points
from pretouch.robot.vectors import placed
from pretouch.types import MovingFixtures, Obstacles, RangeReadings

_ON_AXIS = 1e-9
"""Distance between two axes below which there is no direction from one to the other [m]."""


def beside(
    still: Capsules, moving: MovingFixtures, readings: RangeReadings, now: float, persistence: float
) -> CapsuleArrays:
    """Return what stands and what moves, at the newest reading's stamp.

    No reading counts that is older than `persistence` [s] by `now` [s].
    """
    stamps = readings.stamp[(readings.stamp <= now) & (readings.stamp >= now - persistence)]
    a, b = moving.at(float(stamps.max(initial=-np.inf)) if len(stamps) else moving.stamp)
    return CapsuleArrays(
        np.concatenate([still.link, np.zeros(len(a), np.int64)]),
        np.concatenate([still.a, a]),
        np.concatenate([still.b, b]),
        np.concatenate([still.radius, moving.radius]),
    )


def near_moving(moving: MovingFixtures, model: RobotModel, kin: Kinematics, now: float, first: int) -> Obstacles:
    """Return where each link that moves is nearest to what moves beside it, one obstacle a link.

    Args:
        moving: with one capsule at least, as those that `sound_moving` returns.
        model: the arm.
        kin: its posture.
        now: instant of the step [s].
        first: index that stands for the first link in `Obstacles.unit`; those of the others follow.
    """
    (a, b), body, parts = moving.at(now), model.body, model.parts
    own_a, own_b = placed(body, kin)
    on_body, on_other = nearest_points(own_a[:, None], own_b[:, None], a, b)  # (C, M, 3)
    between, length = on_other - on_body, np.linalg.norm(b - a, axis=1)
    apart, along = np.linalg.norm(between, axis=2), np.linalg.norm(on_other - a, axis=2)
    gap = apart - body.radius[:, None] - moving.radius
    of_part = np.where((body.link == parts[:, None])[..., None], gap, np.inf).reshape(len(parts), -1)
    c, m = np.divmod(of_part.argmin(axis=1), len(moving.radius))
    # any direction will do where the axes meet
    meets = (apart[c, m] <= _ON_AXIS)[:, None]
    n = np.where(meets, (0.0, 0.0, 1.0), between[c, m] / np.where(meets, 1.0, apart[c, m][:, None]))
    share = (along[c, m] / np.where(length[m] > 0.0, length[m], 1.0))[:, None]
    velocity = moving.a_velocity[m] + share * (moving.b_velocity[m] - moving.a_velocity[m])
    return Obstacles(
        unit=first + np.arange(len(parts)), point=on_other[c, m] - moving.radius[m, None] * n,
        ee_distance=np.full(len(parts), np.inf), body_point=on_body[c, m] + body.radius[c, None] * n,
        link=parts.copy(), direction=n, body_distance=gap[c, m], closing_speed=-(n * velocity).sum(axis=1),
    )  # fmt: skip
