"""Visibility of a ball that approaches the arm straight, and the free space for it.

A way is a straight line of the ball's centre: s metres before the contact it is at start + s u. It has grid points
every `GRID_M`, the same at any speed, so that a faster ball never counts as seen where a slower one does not.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.robot.body import Capsules
from pretouch.robot.postures import segment_distance
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.types import BoolArray, FloatArray, IntArray

GRID_M = 0.01
"""Distance between two grid points of a way [m]."""

_TOUCHING_M = 1e-6
"""Penetration of a touching ball by rounding, at most [m]."""


class BallWays(NamedTuple):
    """W ways of one ball."""

    start: FloatArray
    """(W, 3) centre of the ball at the contact [m]."""
    way: FloatArray
    """(W, 3) unit vectors u from there against the motion."""
    radius: float
    """Radius of the ball [m]."""


def ways_free(ways: BallWays, length: float, capsules: Capsules, planes: FloatArray) -> BoolArray:
    """Return the ways (W,) of a length [m] on which a ball has no collision before the contact.

    Args:
        ways: of the ball; the capsule at the contact does not count.
        length: of the ways [m].
        capsules: C of arm and room, base frame, as all arguments.
        planes: (P, 4) rows (normal, offset), the normal pointing into free space.
    """
    ends = ways.start, ways.start + length * ways.way
    gap = segment_distance(ends[0][:, None], ends[1][:, None], capsules.a, capsules.b) - capsules.radius
    height = [(end @ planes[:, :3].T - planes[:, 3]).min(axis=1, initial=np.inf) for end in ends]
    return np.asarray((gap.min(axis=1) >= ways.radius - _TOUCHING_M) & (np.min(height, axis=0) >= ways.radius))


class View(NamedTuple):
    """Ranges of units."""

    limit: FloatArray
    """(K,) farthest reading of the ball, nearer than the arm or the room [m]."""
    light: FloatArray
    """(K,) `light` of `in_view` [m^2]."""
    run: IntArray
    """(K,) steps of the grid for which the ball has to be in view."""


@compiled
def ways_seen(
    ways: BallWays, free: BoolArray, first: int, last: int, sensors: Sensors, cones: Cones, view: View, out: BoolArray
) -> None:
    """Write whether (K, W) each unit sees the ball at `run` + 1 successive grid points.

    Args:
        ways: of the ball.
        free: (W,) ways that count; the others are not visible.
        first: index of the nearest grid point that counts, s = first GRID_M.
        last: index of the farthest.
        sensors: K units.
        cones: of the units.
        view: ranges of the units.
        out: (K, W) written.
    """
    start, way, radius = ways
    position, rotation = sensors.position, sensors.rotation
    near, far = first * GRID_M, last * GRID_M
    for k in range(len(position)):
        ox, oy, oz = position[k, 0], position[k, 1], position[k, 2]
        zx, zy, zz = rotation[k, 0, 2], rotation[k, 1, 2], rotation[k, 2, 2]
        widening, limit, light, run = cones.edge[cones.kind[k], 2], view.limit[k], view.light[k], view.run[k]
        reach = limit + radius
        for w in range(len(start)):
            out[k, w] = False
            if not free[w]:
                continue
            # from the unit the centre is at p + s u: |p + s u|^2 = p . p + s (2 p . u + s), depth linear in s
            x, y, z = start[w, 0] - ox, start[w, 1] - oy, start[w, 2] - oz
            ux, uy, uz = way[w, 0], way[w, 1], way[w, 2]
            along, offset2 = x * ux + y * uy + z * uz, x * x + y * y + z * z
            # the nearest point of the stretch, at s = -p . u or an end, must be in reach
            closest = min(max(-along, near), far)
            if offset2 + closest * (2 * along + closest) > reach * reach:
                continue
            depth, rise = x * zx + y * zy + z * zz, ux * zx + uy * zy + uz * zz
            in_row = 0
            for i in range(first, last + 1):
                s = i * GRID_M
                if in_view(depth + s * rise, offset2 + s * (2 * along + s), radius, widening, limit, light):
                    in_row += 1
                    if in_row > run:
                        out[k, w] = True
                        break
                else:
                    in_row = 0
                    if last - i <= run:  # too few grid points are left for `run` + 1 in a row
                        break


@kernel
def in_view(depth: float, distance2: float, radius: float, widening: float, limit: float, light: float) -> bool:
    """Return whether a unit sees a ball: enough of it in the cone, and nearer than `limit` [m].

    A reading comes from the ball's surface, on average 2/3 of the radius before its centre, d. With A the part of the
    cone's cross-section that the ball fills, the light suffices where light A / d^2 >= 1.

    Args:
        depth: of the ball's centre along the beam [m].
        distance2: of the centre from the unit, squared [m^2].
        radius: of the ball [m].
        widening: tangent of half the cone's angle.
        limit: farthest reading that counts [m].
        light: square of the distance at which a target that fills the cone, slanted as a ball, is just visible [m^2].
    """
    if distance2 <= radius * radius:  # the unit is inside the ball
        return True
    # the mean height of a half-ball over its disc is 2/3 of the radius
    read = np.sqrt(distance2) - 2.0 / 3.0 * radius
    if depth <= 0 or read > limit:
        return False
    # the ball counts as a disc across the beam at the depth of its centre: both circles are in that plane
    cone, aside = depth * widening, np.sqrt(max(0.0, distance2 - depth * depth))
    if aside >= cone + radius:
        return False
    # light A / d^2 >= 1 with A = common area / cone area, multiplied out
    return bool(light * common_area(radius, cone, aside) >= np.pi * cone * cone * read * read)


@kernel
def common_area(r: float, R: float, apart: float) -> float:
    """Return the common area [m^2] of two circles of radii r and R [m] with centres `apart` [m]."""
    if apart >= r + R:
        return 0.0
    if apart <= abs(R - r):  # one lies inside the other
        least = min(r, R)
        return np.pi * least * least
    # two sectors, their half angles by the law of cosines, less the kite of both centres and both crossings
    first = min(1.0, max(-1.0, (apart * apart + r * r - R * R) / (2 * apart * r)))
    second = min(1.0, max(-1.0, (apart * apart + R * R - r * r) / (2 * apart * R)))
    kite = (r + R - apart) * (apart + r - R) * (apart - r + R) * (apart + r + R)
    lens = r * r * np.arccos(first) + R * R * np.arccos(second) - np.sqrt(max(0.0, kite)) / 2
    return max(0.0, lens)
