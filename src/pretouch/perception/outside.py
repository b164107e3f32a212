"""Points of outside sources, such as cameras: which of them are obstacles, and how long they last.

Of any number of points at most `per_link` are kept for each link that moves: the one that is nearest to it by
what is certain of their distance, then the nearest one in another direction, and so on. Each has a place of its own,
so a place goes on showing the same side of the same link, as a unit of the skin does. What is on the arm or a fixture
is left out, the arm being where it was when the points were measured.
"""

import math

import numpy as np

from pretouch.groups import CapsuleArrays, Chain, Kinematics, first_of, no_obstacles
from pretouch.params import OutsidePoints, PerceptionParams
from pretouch.perception.chosen_points import KeptPoints, Placed, PointNumbers, take_points
from pretouch.perception.obstacles import TrackState, track_init
from pretouch.perception.perceive import lasting, show
from pretouch.perception.scene_filter import Fixtures
from pretouch.robot.model import RobotModel
from pretouch.robot.vectors import placed_ends
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray, IntArray, Obstacles, RobotState, SeenPoints
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


@value
class OutsideSetup:
    """What points are chosen with."""

    model: RobotModel
    fixtures: Fixtures
    units: int
    """How many units the skin has: the places' indices follow theirs."""
    numbers: PointNumbers


def outside_setup(
    model: RobotModel, skin: Skin, fixtures: Fixtures, params: PerceptionParams | None
) -> OutsideSetup | None:
    """Return what points are chosen with; None where no outside source is looked at."""
    if params is None or params.outside is None:
        return None
    o, closing = params.outside, params.closing
    numbers = PointNumbers(
        o.persistence_s, o.hidden_s, o.margin_m, o.per_link, params.spread_sigmas, closing is not None,
        math.inf if closing is None else closing.memory_s, o.silent_after_s if params.keep_while_silent else 0.0,
    )  # fmt: skip
    return OutsideSetup(model, fixtures, len(skin), numbers)


def places_of(model: RobotModel, kept: int) -> int:
    """Count the places, so many for each link that moves."""
    return kept * len(moving_links(model))


def see_outside(
    state: OutsideState | None, anew: bool, points: SeenPoints | None, setup: OutsideSetup | None, kin: Kinematics,
    robot: RobotState, now: float,
) -> tuple[Obstacles | None, OutsideState | None]:  # fmt: skip
    """Return what outside sources see, None for nothing, and what to remember.

    Without a source so far, or where none is to be used, that is nothing. Distances are less by `spread_sigmas`
    standard deviations of each point. Points that are newer than the step tell nothing, as with units.

    Args:
        state: memory; None before there was a source.
        anew: whether what was seen is to be forgotten, for time went backwards.
        points: newest set; None for none.
        setup: arm, surroundings and parameters.
        kin: posture of the arm.
        robot: the state that `kin` is of.
        now: instant of this step [s].
    """
    if setup is None or (state is None and points is None):
        return None, state
    numbers, model = setup.numbers, setup.model
    if state is None or anew:
        places = places_of(model, numbers.per_link)
        state = OutsideState(track_init(places), np.zeros(places), -math.inf)
    ends = placed_ends(model.body.link, model.body.a, model.body.b, kin.position, kin.rotation)
    body = CapsuleArrays(model.body.link, ends[0], ends[1], model.body.radius)
    # a source gives the same set until it has a newer one: each is taken in once
    if points is not None and state.heard < points.heard <= now:
        state = _taken(state, points, numbers, body, setup, kin, robot, now)
    # of the tracks `show` changes the directions alone
    tracks, room = state.tracks._replace(direction=state.tracks.direction.copy()), no_obstacles(len(state.sigma))
    keeps = lasting(tracks.times, numbers.persistence_s, numbers.silence_s)
    found = show(tracks, keeps, now, body, kin.position[model.ee], numbers.estimates, room)
    after = OutsideState(tracks, state.sigma, state.heard)
    if found == 0:
        return None, after
    o = first_of(room, found)
    spread = numbers.spread_sigmas * state.sigma[o.unit]
    # eqs. 5-7 know penetration; eq. 3 makes a speed factor of the other distance, so that one ends at 0
    ee_distance, body_distance = np.maximum(o.ee_distance - spread, 0.0), o.body_distance - spread
    return o._replace(unit=o.unit + setup.units, ee_distance=ee_distance, body_distance=body_distance), after


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
    state: OutsideState, points: SeenPoints, numbers: PointNumbers, body: CapsuleArrays, setup: OutsideSetup,
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
