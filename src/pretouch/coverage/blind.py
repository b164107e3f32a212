"""Blind spots: patches of surface on which hardly anything is seen in time, and what to call them."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pretouch.coverage.measure import Coverage
from pretouch.coverage.ways import Ways
from pretouch.types import FloatArray, IntArray

BLIND = 0.1
"""A point is blind if less than this share of the ways to it is seen in time."""
_AXES = ("+x", "-x", "+y", "-y", "+z", "-z")
_SIDES = ("front", "back", "left", "right", "upper side", "underside")
"""Names of the same directions in the base frame: x to the front, y to the left, z upwards."""
_STEADY = 0.5
"""Length of the mean normal, over the postures, from which on a patch has a side of its own in the base frame."""
_NEIGHBOURS = 2.5
"""Points nearer than this many times the side of the square that each stands for are of one patch."""


@dataclass(frozen=True, eq=False)
class BlindSpot:
    """A patch of one link's surface."""

    link: str
    facing: str
    """Axis of the link's frame that it faces."""
    side: str
    """Side of the arm in the base frame, or '' where that changes with the posture."""
    area_m2: float
    center: FloatArray
    """(3,) its middle, link frame [m]."""
    share: float
    """Share of the ways to it that are seen in time."""

    @property
    def sentence(self) -> str:
        """Where it is, in plain words."""
        its, place = f"its {self.side}, " if self.side else "", ", ".join(f"{x:.2f}" for x in self.center)
        return f"{self.link}, {its}facing {self.facing} at ({place}) m of the link: {1e4 * self.area_m2:.0f} cm^2"


def blind_spots(ways: Ways, coverage: Coverage) -> tuple[BlindSpot, ...]:
    """Find the patches of blind points that hang together and face one way, the largest first."""
    share = coverage.point_share
    surface = ways.surface
    facing = _axis(surface.normal)
    found = []
    for link in np.unique(surface.link):
        for axis in range(6):
            with np.errstate(invalid="ignore"):
                here = np.flatnonzero((surface.link == link) & (facing == axis) & (share < BLIND))
            found += [_spot(ways, coverage, here[part]) for part in _patches(surface.point[here], surface.area[here])]
    return tuple(sorted(found, key=lambda spot: -spot.area_m2))


def _axis(normal: FloatArray) -> IntArray:
    """Index in `_AXES` of the axis that each normal (P, 3) is closest to."""
    largest = np.abs(normal).argmax(axis=1)
    return 2 * largest + (normal[np.arange(len(normal)), largest] < 0)


def _patches(point: FloatArray, area: FloatArray) -> list[IntArray]:
    """Indices of the points (N, 3) of each patch."""
    if not len(point):
        return []
    near = cKDTree(point).sparse_distance_matrix(cKDTree(point), _NEIGHBOURS * float(np.sqrt(area.max())))
    count, label = connected_components(near, directed=False)
    return [np.flatnonzero(label == i) for i in range(count)]


def _spot(ways: Ways, coverage: Coverage, points: IntArray) -> BlindSpot:
    model, surface = ways.model, ways.surface
    link, area = int(surface.link[points[0]]), surface.area[points]
    center = np.average(surface.point[points], axis=0, weights=area)
    normal = np.average(surface.normal[points], axis=0, weights=area)
    in_base = np.mean([kin.rotation[link] @ normal for kin in ways.postures], axis=0)
    steady = np.linalg.norm(in_base) > _STEADY
    free = float(coverage.free[:, points].sum())
    return BlindSpot(
        model.links[link],
        _AXES[int(_axis(normal[None])[0])],
        _SIDES[int(_axis(in_base[None])[0])] if steady else "",
        float(area.sum()),
        center,
        float(coverage.seen[:, points].sum()) / free,
    )
