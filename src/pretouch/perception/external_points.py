"""Points of outside sources, such as cameras: which are remembered, and the silence of the sources.

Points on the arm, in its posture at the measurement, and on fixtures are left out.
"""

import math

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.params import OutsidePoints
from pretouch.perception.local_map import LocalMap, Look, remember
from pretouch.perception.obstacles import FASTEST, JUMP_M, Sight, speed_factor
from pretouch.robot.body import Capsules, gap_to, placed
from pretouch.robot.kinematics import Chain, Kinematics, dot, point_velocity, separation
from pretouch.types import FloatArray, SeenPoints

FARTHEST = 100.0
"""A coordinate [m] of this size is implausible: another unit, or a broken message."""
LARGEST_SIGMA = 1.0
"""A standard deviation [m] above this is implausible."""
_ONE_INSTANT = 1e-3
"""Stamps that differ by less [s] count as one: in that time no arm moves by more than 2 mm."""
_FOOTPRINT = 0.2
"""Half the width of a point's footprint as a part of its distance from the arm: near the arm cells are smallest."""


def outside_silence(source_stamp: float, unfit: str, now: float, params: OutsidePoints | None) -> tuple[float, str]:
    """Return the factor in [0, 1] on the speed for outside sources that fall silent, and their fault.

    As with units, silence is no free space: from `slow_after_s` on the arm slows, and at `silent_after_s` it stands. It
    stands at once for a fault `unfit` of the points. `source_stamp` [s] is that of the newest set: -inf before the
    first, NaN without a source so far.
    """
    if params is None:
        return 1.0, ""
    if unfit:
        return 0.0, unfit
    if math.isnan(source_stamp):  # there was no source so far
        return 1.0, ""
    silence = now - source_stamp
    factor = speed_factor(silence, params.slow_after_s, params.silent_after_s)
    if silence < params.silent_after_s:
        return factor, ""
    return 0.0, "has not reported yet" if math.isinf(silence) else f"has been silent for {silence:.2f} s"


@compiled
def usable(stamp: FloatArray, point: FloatArray, sigma: FloatArray) -> tuple[int, int]:
    """Return the number of plausible points of M, and the number of rows without a point, with a NaN."""
    good = nothing = 0
    for m in range(len(stamp)):
        if np.isnan(point[m, 0]) or np.isnan(point[m, 1]) or np.isnan(point[m, 2]):
            nothing += 1
        elif _is_point(stamp[m], point, m, sigma[m]):
            good += 1
    return good, nothing


@kernel
def _is_point(stamp: float, point: FloatArray, m: int, sigma: float) -> bool:
    for i in range(3):
        if not abs(point[m, i]) < FARTHEST:
            return False
    return bool(0.0 <= sigma <= LARGEST_SIGMA and np.isfinite(stamp))


@kernel
def take_points(
    sight: Sight, memory: tuple[LocalMap, FloatArray], new: SeenPoints, posture: tuple[Kinematics, Chain],
    instants: tuple[float, float], fixtures: Capsules,
) -> None:  # fmt: skip
    """Remember the points of the sources that are neither on the arm nor on fixtures.

    A source returns the same set until it has a newer one: each set is used once. A set that is newer than the step is
    ignored, as with units.

    Args:
        sight: constants.
        memory: places so far, and the stamp of the newest set of points (1,) [s], both changed.
        new: points of the sources.
        posture: of the arm.
        instants: those of the step and of the posture [s].
        fixtures: placed.
    """
    (places, source_stamp), (kin, chain), (now, posed), p = memory, posture, instants, sight.outside
    if np.isnan(source_stamp[0]):
        source_stamp[0] = -np.inf
    if not source_stamp[0] < new.heard <= now:
        return
    source_stamp[0], still, count = new.heard, np.zeros(3), places.number[0]
    stamps = np.where(places.unit[:count] < 0, places.stamp[:count], -np.inf)
    before = places.place[:count].copy(), places.velocity[:count].copy(), stamps
    # the arm at the measurement of the points: it may have moved by more than the margin since; the whole arm explains
    # points, the base too, while only moving links have obstacles
    here, moved_to = placed(sight.arm, kin), np.inf
    arm = Capsules(here.link, np.empty_like(here.a), np.empty_like(here.b), here.radius)
    for m in range(count):
        if places.unit[m] < 0:  # the source has answered: its silence keeps no point any more
            hidden = gap_to(places.place, m, here) <= p.margin_m + places.spread[m]
            life = max(p.persistence_s, p.hidden_s) if hidden else p.persistence_s
            places.until[m] = min(places.until[m], places.stamp[m] + life)
    for m in range(len(new.stamp)):
        stamp, sigma = new.stamp[m], new.sigma[m]
        if not (_is_point(stamp, new.point, m, sigma) and 0.0 <= now - stamp <= p.persistence_s):
            continue
        if not abs(stamp - moved_to) < _ONE_INSTANT:
            moved_to = stamp
            _move(here, chain, posed - stamp, arm)
        u = sight.perception.spread_sigmas * sigma
        gap = gap_to(new.point, m, arm)
        if gap <= p.margin_m + u or gap > sight.memory.mark_m + u:
            continue
        if gap_to(new.point, m, fixtures) <= p.margin_m + u or _on_planes(new.point, m, sight.planes, p.margin_m + u):
            continue
        # of the points in one cell the nearest to the arm is remembered: it has the least width
        look = Look(stamp, (p.silent_after_s, p.silent_after_s), _FOOTPRINT * (gap - u), u, -1)
        remember(places, new.point[m], still, look, sight.memory)
    _follow(places, before, sight.memory.closing_s)


@kernel
def _follow(places: LocalMap, before: tuple[FloatArray, FloatArray, FloatArray], memory: float) -> None:
    """Write the velocities of new outside points: that of the nearest earlier place, corrected by the move from there.

    `before` are places, velocities and stamps before the new points, -inf for what units saw. The correction has the
    mean delay of `follow_points`; a point without an earlier place nearby has velocity 0.
    """
    place, velocity, stamp = before
    for m in range(places.number[0]):
        if places.unit[m] >= 0 or (m < len(stamp) and places.stamp[m] == stamp[m]):
            continue
        nearest, least = -1, np.inf
        for b in range(len(stamp)):
            dt = places.stamp[m] - stamp[b]
            apart = separation(place, b, places.place[m])
            if 0.0 < dt <= 3.0 * memory and apart < min(least, FASTEST * dt + JUMP_M):
                nearest, least = b, apart
        if nearest >= 0:
            dt = places.stamp[m] - stamp[nearest]
            gain = 1.0 - np.exp(-dt / (2.0 * memory))
            for i in range(3):
                last = velocity[nearest, i]
                places.velocity[m, i] = last + gain * ((places.place[m, i] - place[nearest, i]) / dt - last)


@kernel
def _move(capsules: Capsules, chain: Chain, age: float, moved: Capsules) -> None:
    """Write the placed capsules of the arm `age` [s] before to `moved`, to first order."""
    for c in range(len(capsules.link)):
        for end, out in ((capsules.a, moved.a), (capsules.b, moved.b)):
            x, y, z = point_velocity(chain, capsules.link[c], end[c, 0], end[c, 1], end[c, 2])
            out[c, 0], out[c, 1], out[c, 2] = end[c, 0] - age * x, end[c, 1] - age * y, end[c, 2] - age * z


@kernel
def _on_planes(points: FloatArray, m: int, planes: FloatArray, within: float) -> bool:
    """Return whether point m is within a distance [m] of a plane, or behind it."""
    for p in range(len(planes)):  # noqa: SIM110  compiled code knows no generators
        if dot(planes[p, :3], points[m]) - planes[p, 3] <= within:
            return True
    return False
