"""Points of outside sources, such as cameras: which of them are obstacles, and how long they last.

Of any number of points at most `per_link` are kept for each link that moves: the one that is nearest to it by
what is certain of their distance, then the nearest one in another direction, and so on. Each has a place of its own,
so a place goes on showing the same side of the same link, as a unit of the skin does. What is on the arm or a fixture
is left out, the arm being where it was when the points were measured.
"""

import math
from typing import NamedTuple

import numpy as np

from pretouch.compiled import entry
from pretouch.groups import CapsuleArrays, Chain, Kinematics
from pretouch.params import OutsidePoints
from pretouch.perception.chosen_points import KeptPoints, Placed, PointNumbers, take_points
from pretouch.perception.closest import ClosestArrays, closest, distances, joined
from pretouch.perception.motion_compensation import closing_speeds
from pretouch.perception.obstacles import HEARD, SEEN, TrackState, track_init
from pretouch.perception.perceive import Perception, PerceptionSetup
from pretouch.robot.model import RobotModel
from pretouch.robot.vectors import placed_ends
from pretouch.types import WHOLE, FloatArray, IntArray, Obstacles, RobotState, SeenPoints
from pretouch.values import value


@value
class OutsideState:
    """What outside sources showed last, in P places."""

    tracks: TrackState
    """As of P units; all were heard when the sources were."""
    sigma: FloatArray
    """(P,) standard deviation of each point [m]."""
    heard: float
    """Newest instant the sources were heard of [s]; -inf before the first."""


def moving_links(model: RobotModel) -> IntArray:
    """Indices of the links that move and have a body, in order: those that points are kept for."""
    return np.unique(model.body.link)


def outside_init(model: RobotModel, kept: int) -> OutsideState:
    """Return the state before any point, with so many places for each link that moves."""
    places = kept * len(moving_links(model))
    return OutsideState(track_init(places), np.zeros(places), -math.inf)


def see_outside(
    state: OutsideState | None, anew: bool, seen: Perception, points: SeenPoints | None, setup: PerceptionSetup,
    kin: Kinematics, robot: RobotState, now: float,
) -> tuple[Perception, OutsideState | None]:  # fmt: skip
    """Add what outside sources see to what the skin does, and return what to remember.

    Without a source so far, or where none is to be used, both are as given. Distances are less by `spread_sigmas`
    standard deviations of each point. Points that are newer than the step tell nothing, as with units.

    Args:
        state: memory; None before there was a source.
        anew: whether what was seen is to be forgotten, for time went backwards.
        seen: by the skin.
        points: newest set; None for none.
        setup: arm, skin, surroundings and parameters; the places follow the indices of the skin's units.
        kin: posture of the arm.
        robot: the state that `kin` is of.
        now: instant of this step [s].
    """
    numbers, model = setup.outside, setup.model
    if numbers is None or (state is None and points is None):
        return seen, state
    if state is None or anew:
        state = outside_init(model, numbers.per_link)
    ends = placed_ends(model.body.link, model.body.a, model.body.b, kin.position, kin.rotation)
    body = CapsuleArrays(model.body.link, ends[0], ends[1], model.body.radius)
    # a source gives the same set until it has a newer one: each is taken in once
    if points is not None and state.heard < points.heard <= now:
        state = _taken(state, points, numbers, body, setup, kin, robot, now)
    before = state.tracks
    # of the tracks `_shown` changes the directions alone
    count, direction = len(state.sigma), before.direction.copy()
    indices, vectors, scalars = np.empty((2, count), WHOLE), np.empty((3, count, 3)), np.zeros((3, count))
    found, nearest = _shown(
        _Places(before.point, direction, before.times, before.motion, state.sigma), now, numbers, body,
        kin.position[model.ee], len(setup.skin), _Room(indices, vectors, scalars),
    )  # fmt: skip
    after = OutsideState(TrackState(before.point, direction, before.times, before.motion), state.sigma, state.heard)
    if found == 0:
        return seen, after
    shown = Obstacles(
        unit=indices[0, :found], link=indices[1, :found], point=vectors[0, :found], body_point=vectors[1, :found],
        direction=vectors[2, :found], ee_distance=scalars[0, :found], body_distance=scalars[1, :found],
        closing_speed=scalars[2, :found],
    )  # fmt: skip
    both = joined(seen.obstacles, shown)
    return Perception(both, seen.distance, min(seen.nearest, nearest), seen.longest_silence), after


def outside_silence(
    state: OutsideState | None, unfit: str, now: float, params: OutsidePoints | None
) -> tuple[float, str]:
    """Factor in [0, 1] on the speed for outside sources that fall silent, and what is wrong with them.

    As with units, silence is no free space: from `slow_after_s` on the arm slows, at `silent_after_s` it stands, and at
    once where `unfit` says what cannot be used of the points given.
    """
    if params is None:
        return 1.0, ""
    if unfit:
        return 0.0, unfit
    # where no source was ever heard of, none is missed
    silence = -math.inf if state is None else now - state.heard
    if silence <= params.slow_after_s:
        return 1.0, ""
    longest = params.silent_after_s
    factor = max(0.0, (longest - silence) / (longest - params.slow_after_s))
    if silence < longest:
        return factor, ""
    return 0.0, "has not been heard yet" if math.isinf(silence) else f"has been silent for {silence:.2f} s"


def _taken(
    state: OutsideState, points: SeenPoints, numbers: PointNumbers, body: CapsuleArrays, setup: PerceptionSetup,
    kin: Kinematics, robot: RobotState, now: float,
) -> OutsideState:  # fmt: skip
    """Return the state with a newer set of points taken in; `body` is the arm's, placed."""
    model, old = setup.model, state.tracks
    arm, others = model.capsules, setup.fixtures.capsules
    motion = old.motion.copy() if numbers.estimates else old.motion
    tracks, sigma = TrackState(old.point.copy(), old.direction, old.times.copy(), motion), state.sigma.copy()
    place = np.full(len(model.links), -1, dtype=np.int64)
    place[moving_links(model)] = np.arange(len(sigma) // numbers.per_link)
    # the whole arm explains points, the base too, while only links that move have places for them
    arm_ends = placed_ends(arm.link, arm.a, arm.b, kin.position, kin.rotation)
    other_ends = placed_ends(others.link, others.a, others.b, kin.position, kin.rotation)
    take_points(
        KeptPoints(tracks.point, tracks.times, motion, sigma), points, now, place,
        Placed(body, arm.link, arm_ends, arm.radius, other_ends, others.radius, setup.fixtures.planes),
        Chain(kin.anchor, kin.axis, model.moved_by, robot.qd), robot.stamp, numbers,
    )  # fmt: skip
    return OutsideState(tracks, sigma, points.heard)


class _Places(NamedTuple):
    """What P places show."""

    point: FloatArray
    """(P, 3) [m]."""
    direction: FloatArray
    """(P, 3) last direction from the body, changed."""
    times: FloatArray
    """(3, P) as of `TrackState` [s]."""
    motion: FloatArray
    """(2, P, 3) likewise."""
    sigma: FloatArray
    """(P,) standard deviation of each point [m]."""


class _Room(NamedTuple):
    """Room for P obstacles, as that of `perceive`."""

    indices: IntArray
    vectors: FloatArray
    scalars: FloatArray


@entry
def _shown(
    places: _Places, now: float, p: PointNumbers, body: CapsuleArrays, ee: FloatArray, units: int, room: _Room
) -> tuple[int, float]:  # fmt: skip
    """Write the obstacles of the places whose points last, as `perceive` does of units.

    Returns how many obstacles there are, and the distance of the nearest from the end-effector's origin [m].
    """
    point, last_direction, times, motion, sigma = places
    indices, vectors, scalars = room.indices, room.vectors, room.scalars
    place, link, near, body_point, direction = indices[0], indices[1], vectors[0], vectors[1], vectors[2]
    ee_distance, body_distance = scalars[0], scalars[1]
    found = 0
    for k in range(len(sigma)):
        # nothing was heard since the point was seen, and silence is no free space
        unanswered = times[HEARD, k] <= times[SEEN, k]
        if now - times[SEEN, k] <= (max(p.persistence_s, p.silence_s) if unanswered else p.persistence_s):
            place[found] = k
            near[found], direction[found] = point[k], last_direction[k]
            if np.isnan(direction[found, 0]):
                # any unit vector will do: it stays only for a point on a capsule's axis, see `closest`
                direction[found, 0], direction[found, 1], direction[found, 2] = 0.0, 0.0, 1.0
            found += 1
    near, direction = near[:found], direction[:found]
    closest(body, near, ClosestArrays(body_point, link, direction, body_distance))
    distances(near, ee, ee_distance)
    if p.estimates:
        # by place: afterwards `place` becomes the index behind those of the skin's units
        closing_speeds(motion, place[:found], direction, scalars[2])
    nearest = np.inf
    for m in range(found):
        k = place[m]
        last_direction[k] = direction[m]
        # eqs. 5-7 know penetration; eq. 3 makes a speed factor of the other distance, so that one ends at 0
        body_distance[m] -= p.spread_sigmas * sigma[k]
        ee_distance[m] = max(0.0, ee_distance[m] - p.spread_sigmas * sigma[k])
        nearest = min(nearest, ee_distance[m])
        place[m] = k + units
    return found, nearest
