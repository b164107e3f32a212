"""Blind spots: patches of surface where hardly any approach is seen in time, and their names."""

from dataclasses import dataclass

import numpy as np
import scipy  # its parts load when they are first used: a quarter of a second that a help does not wait

from pretouch.coverage.measure import Coverage
from pretouch.coverage.ways import Ways
from pretouch.types import FloatArray, IntArray

BLIND = 0.1
"""Share of the ways to a point seen in time below which the point is blind."""
_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
_SIDES = ("front", "back", "left", "right", "upper side", "underside")
"""Names of the same directions in the base frame: x to the front, y to the left, z upwards."""
_STEADY = 0.5
"""Length of the mean normal over the postures from which a patch has a side in the base frame."""
_NEIGHBOURS = 2.5
"""Largest distance of neighbours in a patch, relative to the side of the square of each point."""


@dataclass(frozen=True, eq=False)
class BlindSpot:
    """A patch of one link's surface."""

    link: str
    facing: str
    """Axis of the link's frame towards which it faces."""
    side: str
    """Side of the arm in the base frame, or '' if that changes with the posture."""
    area_m2: float
    center: FloatArray
    """(3,) centre, link frame [m]."""
    share: float
    """Share of the ways to it that are seen in time."""

    @property
    def sentence(self) -> str:
        """Place in plain words."""
        its, place = f"its {self.side}, " if self.side else "", ", ".join(f"{x:.2f}" for x in self.center)
        return f"{self.link}, {its}facing {self.facing} at ({place}) m of the link: {1e4 * self.area_m2:.0f} cm^2"


def blind_spots(ways: Ways, coverage: Coverage) -> tuple[BlindSpot, ...]:
    """Return the connected patches of blind points that face one way, the largest first."""
    surface = ways.surface
    blind = np.flatnonzero(coverage.point_share < BLIND)
    side = 6 * surface.link + _axis(surface.normal)  # a number for each axis of each link
    spots = list[BlindSpot]()
    for one in np.unique(side[blind]):
        here = blind[side[blind] == one]
        tree = scipy.spatial.cKDTree(surface.point[here])
        near = tree.sparse_distance_matrix(tree, _NEIGHBOURS * float(np.sqrt(surface.area[here].max())))
        count, patch = scipy.sparse.csgraph.connected_components(near, directed=False)
        spots += [_spot(ways, coverage, here[patch == i]) for i in range(count)]
    return tuple(sorted(spots, key=lambda spot: -spot.area_m2))


def _axis(normal: FloatArray) -> IntArray:
    """Index in `_AXES` of the axis that each normal (P, 3) is closest to."""
    return np.stack([normal, -normal], axis=2).reshape(-1, 6).argmax(axis=1)


def _spot(ways: Ways, coverage: Coverage, points: IntArray) -> BlindSpot:
    surface, link = ways.surface, int(ways.surface.link[points[0]])
    area = surface.area[points]
    center, normal = (np.average(x[points], axis=0, weights=area) for x in (surface.point, surface.normal))
    in_base = np.mean([kin.rotation[link] @ normal for kin in ways.postures], axis=0)
    return BlindSpot(
        ways.model.links[link],
        _AXES[int(_axis(normal[None])[0])],
        _SIDES[int(_axis(in_base[None])[0])] if np.linalg.norm(in_base) > _STEADY else "",
        float(area.sum()),
        center,
        float(coverage.visible[points].sum() / coverage.free[points].sum()),
    )
