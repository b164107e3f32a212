"""Skins of any number of units, spread over the surface of an arm."""

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit, seat

HEIGHT = 0.008
"""Height of a unit above the surface it is on [m]."""

MOST_UNSURE = (0.02, 0.1)
"""Largest standard deviations of a unit's position [m] and orientation [rad]."""

UNSURE = ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0), (0.0, 1.0), (0.0, 0.0), (0.0, 0.0), (1.0, 1.0), (0.0, 0.0))
"""What is uncertain of each unit, in turns: position, orientation."""


def spread(model: RobotModel, count: int, seed: int) -> Skin:
    """Lay `count` units on the capsules that move, by the size of their sides, each looking straight out.

    A unit that another capsule of its link would cover is laid anew. The turn about the beam is random. Of
    three units in eight the position, the orientation or both are uncertain.
    """
    doubt = np.random.default_rng([seed, count])
    rng = np.random.default_rng(seed)
    body = model.body
    length = np.linalg.norm(body.b - body.a, axis=1)
    share = body.radius * (length + 2 * body.radius)
    units: list[SensorUnit] = []
    while len(units) < count:
        c = int(rng.choice(len(body.radius), p=share / share.sum()))
        out = rng.normal(size=3)
        along, axis = rng.uniform(-body.radius[c], length[c] + body.radius[c]), (body.b[c] - body.a[c]) / length[c]
        if 0 < along < length[c]:
            out -= out @ axis * axis
        elif out @ axis * (along - length[c] / 2) < 0:
            out = -out
        out /= np.linalg.norm(out)
        foot = body.a[c] + np.clip(along, 0.0, length[c]) * axis
        place = foot + (body.radius[c] + HEIGHT) * out
        if seat(model, int(body.link[c]), place).height < HEIGHT / 2:
            continue
        side = np.cross(out, rng.normal(size=3))
        side /= np.linalg.norm(side)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = np.column_stack([side, np.cross(out, side), out]), place
        sigmas = doubt.uniform(0.0, MOST_UNSURE) * UNSURE[len(units) % len(UNSURE)]
        units.append(SensorUnit(f"unit_{len(units)}", model.links[body.link[c]], T, *sigmas))
    return Skin(units, model)
