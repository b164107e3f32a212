"""Skins whose units are anywhere on the arm."""

import numpy as np

from pretouch.errors import SkinError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit

HEIGHT = 0.008
"""Of the IMU above the surface of its link [m]."""


def random_skin(model: RobotModel, seed: int, first_link: bool = False) -> Skin:
    """Put one unit on each link that has a surface and that two joints move, anywhere on it, turned anyhow.

    What turns about one axis only cannot be found along that axis: `first_link` takes such a link too.
    """
    rng = np.random.default_rng([seed, 11])
    covered, joints = set(model.capsules.link.tolist()), model.moved_by.sum(axis=1)
    links = [i for i in range(len(model.links)) if i in covered and joints[i] >= (1 if first_link else 2)]
    return Skin([_random_unit(model, link, rng) for link in links], model)


def _random_unit(model: RobotModel, link: int, rng: np.random.Generator) -> SensorUnit:
    surface, name = model.capsules.of_links(np.array([link])), model.links[link]
    while True:
        k = rng.integers(len(surface))
        along = surface.b[k] - surface.a[k]
        outwards = rng.normal(size=3)
        outwards -= along * (outwards @ along) / max(along @ along, 1e-12)
        z = outwards / np.linalg.norm(outwards)
        x = np.cross(rng.normal(size=3), z)
        x /= np.linalg.norm(x)
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
        pose[:3, 3] = surface.a[k] + rng.uniform() * along + (surface.radius[k] + HEIGHT) * z
        unit = SensorUnit(f"on_{name}", name, pose)
        try:
            Skin([unit], model)
        except SkinError:  # inside a neighbouring capsule of the same link
            continue
        return unit
