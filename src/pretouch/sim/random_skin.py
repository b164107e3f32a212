"""Skins to try things on: units anywhere on an arm."""

import numpy as np

from pretouch.errors import SkinError
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.types import FloatArray

HEIGHT = 0.008
"""Height of the IMU above the surface of its link [m]: on its board, in its case."""

_TRIES = 1000
"""A place may lie inside a neighbouring capsule of the same link; this often another is drawn."""


def random_skin(model: RobotModel, seed: int, first_link: bool = False) -> Skin:
    """Put one unit on each link that has a surface and that two joints move, anywhere on it, turned anyhow.

    What turns about one axis only cannot be found along that axis: `first_link` takes such a link too. SkinError if a
    link has no place for a unit.
    """
    rng = np.random.default_rng([seed, 11])
    joints, least = model.moved_by.sum(axis=1), 1 if first_link else 2
    links = [link for link in np.unique(model.capsules.link).tolist() if joints[link] >= least]
    return Skin([_random_unit(model, link, rng) for link in links], model)


def _random_unit(model: RobotModel, link: int, rng: np.random.Generator) -> SensorUnit:
    name, surface = model.links[link], model.capsules.of_links(np.array([link]))
    for _ in range(_TRIES):
        unit = SensorUnit(f"on_{name}", name, _random_pose(surface, rng))
        try:
            Skin([unit], model)
        except SkinError:
            continue
        return unit
    raise SkinError(f"No place for a unit was found on {name}: its capsules lie inside each other, part them.")


def _random_pose(surface: Capsules, rng: np.random.Generator) -> FloatArray:
    """Draw a pose (4, 4) on the side of one of some capsules, link frame: z outwards, `HEIGHT` above it [m]."""
    k = rng.integers(len(surface.radius))
    along = surface.b[k] - surface.a[k]
    outwards = rng.normal(size=3)
    outwards -= along * (outwards @ along) / max(along @ along, 1e-12)
    z = outwards / np.linalg.norm(outwards)
    x = np.cross(rng.normal(size=3), z)
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    pose[:3, 3] = surface.a[k] + rng.uniform() * along + (surface.radius[k] + HEIGHT) * z
    return pose
