"""Filter of returns from the arm itself or from declared fixtures: ray casting against the model."""

from dataclasses import dataclass

import numpy as np

from pretouch.compiled import compiled, inlined, kernel
from pretouch.errors import FixtureError
from pretouch.perception.obstacles import locate
from pretouch.robot.body import Capsules, gap_to, no_capsules, to_axis
from pretouch.robot.kinematics import dot
from pretouch.sensing.sensor import Cones, Sensors
from pretouch.types import BoolArray, FloatArray

_ROUNDING = 1e-9
"""Distance within which rounding may put a point on either side of a surface [m]."""


@dataclass(frozen=True)
class Fixtures:
    """Known bodies around the arm: planes, and capsules on link 0, the world."""

    planes: FloatArray
    """(P, 4) rows (normal, offset): normal . p = offset, the normal pointing into free space."""
    capsules: Capsules

    def __post_init__(self) -> None:
        planes, c = np.array(self.planes, dtype=np.float64), self.capsules
        object.__setattr__(self, "planes", planes)
        if planes.ndim != 2 or planes.shape[1] != 4 or not np.isfinite(planes).all():
            raise FixtureError(
                f"The planes are {planes.tolist()}: give rows of four finite numbers, normal and offset."
            )
        count = len(c.radius)
        if c.a.shape != (count, 3) or c.b.shape != (count, 3) or c.link.shape != (count,):
            shapes = f"{c.link.shape}, {c.a.shape}, {c.b.shape} and {c.radius.shape}"
            raise FixtureError(f"The capsules' links, ends and radii have the shapes {shapes}: give one of each.")
        numbers = np.concatenate([c.a.ravel(), c.b.ravel(), c.radius])
        if not np.isfinite(numbers).all() or np.any(c.radius < 0):
            raise FixtureError("A capsule has an end or a radius that is not finite, or a negative radius: correct it.")
        if c.link.any():
            raise FixtureError(f"The capsules are on the links {c.link.tolist()}: fixtures stand on link 0, the world.")


def no_fixtures() -> Fixtures:
    """Return fixtures without any body."""
    return Fixtures(np.zeros((0, 4)), no_capsules())


@compiled
def bounds(capsules: Capsules) -> FloatArray:
    """Return spheres (4, C) round capsules, slightly larger than necessary: x, y, z and radius [m]."""
    _, a, b, radius = capsules
    spheres = np.empty((4, len(radius)))
    for c in range(len(radius)):
        length2 = 0.0
        for i in range(3):
            spheres[i, c] = (a[c, i] + b[c, i]) / 2
            length2 += (b[c, i] - a[c, i]) ** 2
        # larger by more than rounding, so that the capsules left out change no bit of the result
        spheres[3, c] = (np.sqrt(length2) / 2 + radius[c]) * (1 + 1e-12) + 1e-12
    return spheres


@kernel
def leave_out(
    shows: BoolArray, fresh: BoolArray, distance: FloatArray, ends: FloatArray, aside: float, sensors: Sensors,
    capsules: Capsules, cones: Cones,
) -> None:  # fmt: skip
    """Remove from `shows` (K,) each fresh reading that a placed capsule explains, by a return up to `ends` (K,) [m].

    With an `aside` > 0 [m], a capsule that the cone misses by less explains a `distance` (K,) [m] of its place too.
    """
    spheres, points = bounds(capsules), locate(sensors.position, sensors.rotation, distance)
    for k in range(len(shows)):
        end = ends[k]
        if fresh[k] and shows[k] and aside > 0:  # first, for casting rays takes longer
            beside = distance[k] * cones.edge[cones.kind[k], 2] + aside
            shows[k] = gap_to(points, k, capsules, sensors.link[k]) > beside
        if fresh[k] and shows[k]:
            # a farther return does not explain the reading, and the first one within is enough
            shows[k] = capsule_return(sensors, k, capsules, spheres, cones, end, end) > end


@compiled
def nearest_capsule(sensors: Sensors, k: int, capsules: Capsules, spheres: FloatArray, cones: Cones) -> float:
    """Return the least distance [m] at which sensor k sees a placed capsule; `spheres` are those of `bounds`."""
    return capsule_return(sensors, k, capsules, spheres, cones, np.inf, -np.inf)


@kernel
def capsule_return(
    sensors: Sensors, k: int, capsules: Capsules, spheres: FloatArray, cones: Cones, within: float, enough: float
) -> float:
    """Return the least distance [m] up to `within` at which sensor k sees a capsule, infinite without one.

    The first return that is no farther than `enough` [m] ends the search; it need not be the nearest.
    """
    position, rotation, link, own = sensors.position, sensors.rotation, capsules.link, sensors.link[k]
    edge, rays = cones.edge[cones.kind[k]], cones.rays[cones.kind[k]]
    cos, sin = edge[0], edge[1]
    far2, x, y, z = np.empty(len(link)), position[k, 0], position[k, 1], position[k, 2]
    for c in range(len(link)):  # a loop of its own: the processor runs four iterations at once
        u, v, w = spheres[0, c] - x, spheres[1, c] - y, spheres[2, c] - z
        far2[c] = u * u + v * v + w * w
    bx, by, bz = rotation[k, 0, 2], rotation[k, 1, 2], rotation[k, 2, 2]
    start = position[k, 0] * bx + position[k, 1] * by + position[k, 2] * bz
    least = np.inf
    for c in range(len(link)):
        reach = spheres[3, c] + _ROUNDING
        if link[c] == own or far2[c] > (within + reach) ** 2:  # a unit does not see its own link
            continue
        # the cone can meet the sphere only if it is ahead, and if cos l - sin z <= reach as in `_cone_meets`
        along = spheres[0, c] * bx + spheres[1, c] * by + spheres[2, c] * bz - start
        # the test below is squared: `inside` is positive where along >= -reach, for sin < 1
        inside = reach + sin * along
        if along < -reach or (far2[c] - along * along) * (cos * cos) > inside * inside:
            continue
        # rays cost most: they are cast only at capsules that pass both tests
        if _cone_meets(sensors, k, capsules, c, edge, within):
            least = min(least, _cast(sensors, k, capsules, c, rays, enough))
            if least <= enough:
                return least
    return least if least <= within else np.inf


@compiled
def plane_return(sensors: Sensors, k: int, planes: FloatArray, cones: Cones, within: float) -> float:
    """Return the least distance [m] up to `within` at which sensor k sees a plane from its free side, else infinity."""
    position, rotation, rays = sensors.position, sensors.rotation, cones.rays[cones.kind[k]]
    least, R = np.inf, rotation[k]
    for m in range(len(planes)):
        normal = planes[m]
        height = normal[0] * position[k, 0] + normal[1] * position[k, 1] + normal[2] * position[k, 2] - normal[3]
        # visible from its free side only; no ray reaches the plane within less than the height over it
        if 0 <= height <= within:
            # in the frame of the sensor and the rays
            x = normal[0] * R[0, 0] + normal[1] * R[1, 0] + normal[2] * R[2, 0]
            y = normal[0] * R[0, 1] + normal[1] * R[1, 1] + normal[2] * R[2, 1]
            z = normal[0] * R[0, 2] + normal[1] * R[1, 2] + normal[2] * R[2, 2]
            for i in range(len(rays)):
                rate = x * rays[i, 0] + y * rays[i, 1] + z * rays[i, 2]
                if rate < 0:
                    least = min(least, -height / rate)  # height + t rate = 0
    return least if least <= within else np.inf


@inlined
def _cone_meets(sensors: Sensors, k: int, capsules: Capsules, c: int, edge: FloatArray, within: float) -> bool:
    """Return whether the cone of sensor k can meet capsule c within a distance [m]; false is always right.

    With z along the beam and l across it, z sin - l cos is by how much a point lies inside the tangent plane of the
    cone: no point of the capsule's axis may be farther out than the radius. On the axis that is a convex function,
    whose least value is where its slope vanishes or at an end.
    """
    position, rotation, a, b = sensors.position, sensors.rotation, capsules.a, capsules.b
    cos, sin = edge[0], edge[1]
    reach = capsules.radius[c] + _ROUNDING
    ux, uy, uz = b[c, 0] - a[c, 0], b[c, 1] - a[c, 1], b[c, 2] - a[c, 2]
    x, y, z = a[c, 0] - position[k, 0], a[c, 1] - position[k, 1], a[c, 2] - position[k, 2]
    bx, by, bz = rotation[k, 0, 2], rotation[k, 1, 2], rotation[k, 2, 2]
    start, rise = x * bx + y * by + z * bz, ux * bx + uy * by + uz * bz
    if max(start, start + rise) < -reach:  # all of it is behind the sensor
        return False
    if to_axis(position, k, a, b, c)[1] > within + reach:
        return False
    # across the beam: l(s)^2 = across + 2 s mixed + s^2 slope along the axis, s from 0 to 1
    across = max(0.0, x * x + y * y + z * z - start * start)
    mixed = x * ux + y * uy + z * uz - start * rise
    slope = max(0.0, ux * ux + uy * uy + uz * uz - rise * rise)
    least = min(
        cos * np.sqrt(across) - sin * start, cos * np.sqrt(max(0.0, across + 2 * mixed + slope)) - sin * (start + rise)
    )
    # The slope vanishes where l cos grows as fast as z sin. With spread <= 0 it does so nowhere: the axis is closer to
    # the beam's direction than the edge of the cone is, and the least value is at an end.
    spread = cos * cos * slope - sin * sin * rise * rise
    if slope > 0 and spread > 0:
        middle = -mixed / slope
        off = np.sqrt(max(0.0, across - mixed * mixed / slope))
        s = middle + sin * rise * off / np.sqrt(slope * spread)  # (s - middle)^2 slope spread = (sin rise off)^2
        if 0 < s < 1:
            l2 = max(0.0, across + s * (2 * mixed + s * slope))
            least = min(least, cos * np.sqrt(l2) - sin * (start + s * rise))
    return bool(least <= reach)


@inlined
def _cast(sensors: Sensors, k: int, capsules: Capsules, c: int, rays: FloatArray, enough: float) -> float:
    """Return the least distance [m] to capsule c along the rays of sensor k, or the first one that is enough."""
    position, rotation, a, b = sensors.position, sensors.rotation, capsules.a, capsules.b
    radius = capsules.radius[c]
    ux, uy, uz = b[c, 0] - a[c, 0], b[c, 1] - a[c, 1], b[c, 2] - a[c, 2]
    x, y, z = position[k, 0] - a[c, 0], position[k, 1] - a[c, 1], position[k, 2] - a[c, 2]
    R = rotation[k]
    # in the frame of the sensor and the rays
    ux, uy, uz = (
        R[0, 0] * ux + R[1, 0] * uy + R[2, 0] * uz,
        R[0, 1] * ux + R[1, 1] * uy + R[2, 1] * uz,
        R[0, 2] * ux + R[1, 2] * uy + R[2, 2] * uz,
    )
    x, y, z = (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )
    # a . a, a . o and o . o are the same for all rays
    aa, ao, oo = ux * ux + uy * uy + uz * uz, ux * x + uy * y + uz * z, x * x + y * y + z * z
    if _inside(aa, ao, oo, radius):
        return 0.0
    least = np.inf
    for i in range(len(rays)):
        ar = ux * rays[i, 0] + uy * rays[i, 1] + uz * rays[i, 2]
        rest = x * rays[i, 0] + y * rays[i, 1] + z * rays[i, 2]
        least = min(least, _from_outside(aa, ao, oo, ar, rest, radius))
        if least <= enough:
            break
    return least


@kernel
def ray_capsule(p: FloatArray, ray: FloatArray, a: FloatArray, b: FloatArray, radius: float) -> float:
    """Return the distance [m] along a unit ray (3,) from p (3,) to a capsule, 0 from inside, infinite for a miss."""
    axis, offset = b - a, p - a
    aa, ao, oo = dot(axis, axis), dot(axis, offset), dot(offset, offset)
    if _inside(aa, ao, oo, radius):
        return 0.0
    return _from_outside(aa, ao, oo, dot(axis, ray), dot(ray, offset), radius)


@kernel
def _inside(aa: float, ao: float, oo: float, radius: float) -> bool:
    """Return whether a point is in a capsule; aa, ao, oo are products of the axis a and the point's offset o."""
    along = 0.0 if aa == 0 else min(1.0, max(0.0, ao / aa))
    return bool(oo - along * (2 * ao - along * aa) <= radius * radius)  # |o - s a|^2 <= r^2


@kernel
def _from_outside(aa: float, ao: float, oo: float, ar: float, rest: float, radius: float) -> float:
    """Return the distance of `ray_capsule` from outside; see `_inside`; with the ray r, ar = a . r and rest = o . r."""
    best = np.inf
    # the endless cylinder round the axis: quad t^2 + 2 half_b t + (aa oo - ao^2 - r^2 aa) = 0 with |r| = 1
    quad = aa - ar * ar
    if quad > 1e-12 * aa:  # else along the axis, or a ball: only the end spheres can be met
        half_b = aa * rest - ao * ar
        disc = half_b * half_b - quad * (aa * oo - ao * ao - radius * radius * aa)
        if disc < -1e-9 * quad * aa:
            return best  # past the whole cylinder, and the spheres at its ends with it
        t = (-half_b - np.sqrt(max(disc, 0.0))) / quad
        # met between both ends, 0 < a . (o + t r) < a . a; a start on the surface may be rounded to behind it
        if disc >= 0 and t >= -_ROUNDING and 0 < ao + t * ar < aa:
            best = max(t, 0.0)
    for end in range(2):
        # of the sphere round the far end: its offset is o - a
        half_b = rest - end * ar
        disc = half_b * half_b - (oo - end * (2 * ao - aa) - radius * radius)
        if disc >= 0:
            # from outside: where the nearer root is behind, so is the whole sphere
            t = -half_b - np.sqrt(disc)
            if 0 <= t < best:
                best = t
    return best
