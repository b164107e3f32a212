"""Skins to try things on: units anywhere on an arm, or elsewhere than the controller believes."""

from dataclasses import dataclass, replace

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


@dataclass(frozen=True)
class Misplacement:
    """Error of each unit's pose in the controller's skin file."""

    position_mm: float = 0.0
    orientation_deg: float = 0.0
    declared: bool = False
    """True if the skin file declares the error as standard deviations."""


def misplaced(skin: Skin, model: RobotModel, error: Misplacement, seed: int) -> tuple[Skin, int]:
    """Return what the controller believes of a skin, and how many drawn poses no skin file could hold.

    Each unit's position is off in a random direction, its orientation about a random axis, both uniform on the sphere:
    a turn about the beam changes nothing, and the beam itself tilts by 0.79 of the angle on average. Direction and axis
    depend on the seed and the unit, not on the error's size. A pose that `Skin` refuses, inside the unit's own link, is
    drawn again.
    """
    believed = [
        _believed(unit, model, error, np.random.default_rng([seed, 13, k])) for k, unit in enumerate(skin.mounted)
    ]
    units = [unit for unit, _ in believed]
    if error.declared:  # along, and about, one axis of an error that may point anywhere
        position, turn = (
            error.position_mm / 1000 / np.sqrt(3.0),
            float(np.radians(error.orientation_deg)) / np.sqrt(3.0),
        )
        units = [replace(unit, position_sigma=position, orientation_sigma=turn) for unit in units]
    return Skin(units, model), sum(refused for _, refused in believed)


def _believed(
    unit: SensorUnit, model: RobotModel, error: Misplacement, rng: np.random.Generator
) -> tuple[SensorUnit, int]:
    from scipy.spatial.transform import Rotation  # a fifth of a second, and few skins are misplaced

    T, refused = unit.T_link_sensor.copy(), 0
    while True:
        off, axis = (v / np.linalg.norm(v) for v in rng.standard_normal((2, 3)))
        T[:3, 3] = unit.T_link_sensor[:3, 3] + error.position_mm / 1000 * off
        turn = Rotation.from_rotvec(error.orientation_deg * axis, degrees=True)
        T[:3, :3] = unit.T_link_sensor[:3, :3] @ turn.as_matrix()
        believed = replace(unit, T_link_sensor=T)
        try:
            Skin([believed], model)
        except SkinError:
            refused += 1
        else:
            return believed, refused
