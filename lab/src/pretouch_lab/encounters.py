"""Encounters of an arm with a person: touches with the speeds before them, and ghosts that slow the arm."""

from collections import Counter
from collections.abc import Sequence
from itertools import compress
from typing import NamedTuple

import numpy as np

from pretouch.explanation import Limit, binding, limited_by
from pretouch.modes import Event, Mode
from pretouch.params import AdmittanceParams
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import spans
from pretouch.types import SEEN_NOW_S, BoolArray, ControlStep, FloatArray, IntArray
from pretouch_lab.bench.obstacle import Nearest, ShapeAt, nearest
from pretouch_lab.run import Row
from pretouch_lab.table import peak, rounded
from pretouch_lab.trial import Record

SOFT_M_S, SOFT_N = 0.06, 15.0
"""Largest speed of the arm before a soft touch [m/s], and largest force [N]."""
GHOST_M = 0.15
"""An obstacle with nothing within this distance of its point is a ghost [m]."""
LEAVING_S = 1.0
"""Time in which a hand withdraws [s]."""
_APART_S = 0.2
"""Longest break within one contact [s]."""
_PLACE_M, _LOOKS = 0.05, 10
"""Edge of the cells in which a place is the same [m], and steps in which a unit looks at one until it is seen empty:
0.1 s, for several readings."""
_FLICKER_S = 0.1
"""Longest break within the time that a ghost holds the arm [s]: a reading comes every 16 to 67 ms."""


class Encounter(NamedTuple):
    """The beginning of a contact after none, its force, and the speeds before it."""

    step: int
    """Index of the last step before it."""
    link: int
    """Index of the link that touches."""
    arm_m_s: float
    """Speed of the touching point of the arm towards the person, along the normal [m/s]."""
    hand_m_s: float
    """Speed of the person towards that point [m/s]."""
    peak_n: float
    """Largest force until the next one begins, but for the time in which the hand withdraws [N]."""
    leaving_n: float
    """Largest force in that time [N]: a hand that leaves pushes an arm that it touches aside."""

    @property
    def by_hand(self) -> bool:
        """True if a hand that moves touches an arm that waits: the hand is faster, and the arm is slow."""
        return self.arm_m_s <= SOFT_M_S and self.hand_m_s > max(self.arm_m_s, 0.0)

    @property
    def soft(self) -> bool:
        """True if neither speed nor force of the arm is beyond `SOFT_M_S` and `SOFT_N`."""
        return self.arm_m_s <= SOFT_M_S and self.peak_n <= SOFT_N


def hand_velocity(record: Record, at: int) -> FloatArray:
    """Velocity (3,) [m/s] of the person's hand before a step; zero without a hand."""
    before = max(at - 2, 0)
    moved = record.hand_position[at] - record.hand_position[before]
    duration = record.steps[at].stamp - record.steps[before].stamp
    return moved / duration if duration > 0 and np.isfinite(moved).all() else np.zeros(3)


def nearest_of(record: Record, model: RobotModel, shape: ShapeAt, at: int, link: int) -> Nearest:
    """Return the closest points of the person and the rigid body of a link at a step."""
    body = model.body.of_links(np.flatnonzero(model.rigid == model.rigid[link]))
    return nearest(model.kinematics(record.steps[at].q), body, shape(record.hand_position[at]))


def encounters(record: Record, model: RobotModel, shape: ShapeAt, leaves: Sequence[float] = ()) -> list[Encounter]:
    """Return the separate touches of a trial, in their order.

    Args:
        record: of the trial.
        model: of the arm.
        shape: the person's surface.
        leaves: instants at which the person begins to withdraw the hand [s].
    """
    time, force, every = record.true_time, np.linalg.norm(record.true_force, axis=1), list[Encounter]()
    pressed, steps = time[force > TOUCH_N], record.times()
    begun = [t for t in record.touches if not ((pressed < t.time - 1e-9) & (pressed > t.time - _APART_S)).any()]
    ends = [*(touch.time for touch in begun[1:]), np.inf]
    leaving = np.any([(time >= leave) & (time < leave + LEAVING_S) for leave in leaves], axis=0)
    for touch, end in zip(begun, ends, strict=False):
        at = int(np.searchsorted(steps, touch.time)) - 1
        if at >= 0:
            way = nearest_of(record, model, shape, at, touch.link).direction
            speeds = float(touch.velocity @ way), float(-hand_velocity(record, at) @ way)
            during = (time >= touch.time) & (time < end)
            peaks = (rounded(peak(force[during & when]), 1) for when in (~leaving, leaving))
            every.append(Encounter(at, touch.link, *(rounded(speed, 4) for speed in speeds), *peaks))
    return every


def met(every: list[Encounter]) -> Row:
    """Return the measures of a trial's encounters: those by the hand are counted apart."""
    own = [each for each in every if not each.by_hand]
    return {
        "untouched": not own,
        "soft": all(each.soft for each in own),
        "fastest_m_s": max((each.arm_m_s for each in own), default=None),
        "hardest_n": max((each.peak_n for each in own), default=None),
        "by_hand": len(every) - len(own) + sum(each.leaving_n > SOFT_N for each in own),
    }


def causes(step: ControlStep) -> IntArray:
    """Return the indices of the obstacles that slow the motion of a step, or that it waits for after a contact."""
    limit = limited_by(step)
    if limit.by is Limit.APPROACH:
        return step.restricted[binding(step)]
    if step.mode is not Mode.TRACK and step.event in (Event.YIELDING, Event.GIVEN_UP):
        near = step.obstacles
        return np.flatnonzero((near.body_distance < AdmittanceParams.near_m) & (near.age <= SEEN_NOW_S))
    return np.array([limit.obstacle] if limit.obstacle >= 0 else [], np.int64)


def looked_at(model: RobotModel, skin: Skin, step: ControlStep, points: FloatArray) -> BoolArray:
    """Return flags (M,) of points (M, 3) [m] that a unit has in view and shows nothing nearer."""
    kin, T, cones = model.kinematics(step.q), skin.T_link_sensor, skin.cones
    rotation, position = kin.rotation[skin.link], kin.position[skin.link]
    to = points[:, None] - position - np.einsum("kij,kj->ki", rotation, T[:, :3, 3])
    along, away = np.einsum("mki,kij,kj->mk", to, rotation, T[:, :3, 2]), np.linalg.norm(to, axis=2)
    inside = (along > cones.edge[cones.kind, 0] * away) & (away < cones.range[cones.kind, 1])
    return np.asarray((inside & ~(step.range_distance < away)).any(axis=1))


def ghosts(record: Record, model: RobotModel, skin: Skin, radius: float, speed: float) -> Row:
    """Return what obstacles do whose points are farther than `GHOST_M` from the person, or in a room without one.

    Args:
        record: of the trial.
        model: of the arm.
        skin: whose obstacles they are.
        radius: of the person's hand [m].
        speed: that the arm should have along its path [m/s].

    Returns:
        `ghost_share`, the share of the steps after the start that ghosts alone slow; `ghost_s`, the longest time in
        which they hold the arm below half of its speed [s]; `empty_s`, the same of ghosts whose place was seen empty.
    """
    begin = record.started()
    steps, hands, empty = record.steps[begin:], record.hand_position[begin:], Counter[tuple[int, ...]]()
    slowed = np.zeros((2, len(steps)), np.bool_)
    for i, (step, hand) in enumerate(zip(steps, hands, strict=True)):
        points = step.obstacles.point[causes(step)]
        real = np.linalg.norm(points - hand, axis=1) - radius <= GHOST_M  # False without a hand
        places = [tuple(place) for place in np.floor(points / _PLACE_M).astype(int).tolist()]
        if len(points) and not real.any():
            empty.update(compress(places, looked_at(model, skin, step, points)))
            slowed[:, i] = True, any(empty[place] >= _LOOKS for place in places)
        for place in compress(places, real):
            empty.pop(place, None)
    times, phases = np.array([(step.stamp, step.path_phase) for step in steps]).T
    period = float(times[1] - times[0])
    slow = np.diff(phases, prepend=phases[0]) < 0.5 * speed * period
    lasting = [np.convolve(flags, np.ones(round(_FLICKER_S / period)))[: len(steps)] > 0.5 for flags in slowed]
    longest = [max((end - first for first, end in spans(slow & each)), default=0) * period for each in lasting]
    return {"ghost_share": rounded(slowed[0].mean(), 5), "ghost_s": rounded(longest[0]), "empty_s": rounded(longest[1])}
