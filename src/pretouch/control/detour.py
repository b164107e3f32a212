"""Going round what blocks the path: the path is shifted aside by a bounded offset while it does, and back after."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.params import AnticipationParams
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

_BLOCKED, _FREE = 0.5, 0.8
"""Part of the speed asked for below which the way is blocked, and above which it is clear."""
_IN_THE_WAY = 0.3
"""Cosine between a motion and an obstacle's direction from which the obstacle is in its way."""
_ALONG = 0.2
"""Sine between the task and the normal from which the task says which side to take."""


@value
class Detour:
    """Where the path is shifted, and for how long something has been in its way."""

    vectors: FloatArray
    """(2, 3) shift of the path [m]; side it was first shifted to, a unit vector, or zero without a detour."""
    times: FloatArray
    """(2,) how long the way has been clear, and how long the arm has been kept from its path [s]."""

    @property
    def offset(self) -> FloatArray:
        """Shift of the path (3,) [m]."""
        return self.vectors[0]

    @property
    def blocked(self) -> float:
        """How long the arm has been kept from its path [s]."""
        return float(self.times[1])


def detour_init() -> Detour:
    """Return no detour."""
    return Detour(np.zeros((2, 3)), np.zeros(2))


def next_detour(
    state: Detour, asked: FloatArray, moving: FloatArray, direction: FloatArray, limit: FloatArray, hand: BoolArray,
    params: AnticipationParams, period: float,
) -> Detour:  # fmt: skip
    """Shift the path on by one period.

    Blocked, it is shifted across the normal of what is most in the way, towards the side taken first, so it does not
    waver; with the way clear for a while, it returns, unless something is in the way of that. At its largest shift it
    stays.

    Args:
        state: the detour so far.
        asked: (3,) velocity asked of the end-effector [m/s].
        moving: (3,) what it moves with [m/s].
        direction: (R, 3) from the body to what restricts it.
        limit: (R,) what approach is allowed [m/s].
        hand: (R,) whether it is the hand that is near.
        params: largest shift and speeds.
        period: control period [s].
    """
    p, after = params, Detour(state.vectors.copy(), state.times.copy())
    shift(
        after.vectors, after.times, asked, moving, direction, limit, hand,
        p.detour_distance_m if p.detour else 0.0, p.detour_speed_m_s * period, p.detour_speed_m_s, p.detour_hold_s,
        period,
    )  # fmt: skip
    return after


@compiled
def shift(
    vectors: FloatArray, times: FloatArray, asked: FloatArray, moving: FloatArray, direction: FloatArray,
    limit: FloatArray, hand: BoolArray, most: float, step: float, speed: float, hold: float, period: float,
) -> None:  # fmt: skip
    """Change the vectors (2, 3) and times (2,) of a `Detour` by one period, as `next_detour` says."""
    offset, side = vectors[0], vectors[1]
    wanted2 = (asked * asked).sum()
    progress = (asked * moving).sum() / wanted2 if wanted2 > 1e-6 else 1.0
    first = _most_in_the_way(asked, direction, limit, hand)
    if first >= 0 and progress < _BLOCKED:
        times[0] = 0.0
        times[1] += period
        if most > 0:
            _shift(offset, side, asked, direction, hand, first, most, step)
        return
    if progress < _FREE:
        return
    times[0] += period
    times[1] = 0.0
    size = np.sqrt((offset * offset).sum())
    if size > 0 and times[0] >= hold:
        back = -offset / size
        for r in range(len(limit)):
            if hand[r] and (back * direction[r]).sum() > _IN_THE_WAY and limit[r] < 2 * speed:
                return
        offset += back * min(step, size)
        if size <= step:
            offset[:], side[:] = 0.0, 0.0


@compiled
def _most_in_the_way(asked: FloatArray, direction: FloatArray, limit: FloatArray, hand: BoolArray) -> int:
    """Return which of the obstacles near the hand takes most of the velocity asked for, -1 for none."""
    most, which = 0.0, -1
    for r in range(len(limit)):
        excess = (asked * direction[r]).sum() - limit[r]
        if hand[r] and excess > most:
            most, which = excess, r
    return which


@compiled
def _shift(
    offset: FloatArray, side: FloatArray, asked: FloatArray, direction: FloatArray, hand: BoolArray, first: int,
    most: float, step: float,
) -> None:  # fmt: skip
    """Move the offset across the normal of obstacle `first`, to the side (3,) taken before, or to one that is chosen.

    The side is that of the task where it already passes, or else upwards or level, where fewest other things are.
    """
    normal = direction[first]
    if not side.any():
        across = asked - (asked * normal).sum() * normal
        size = np.sqrt((across * across).sum())
        if size > _ALONG * np.sqrt((asked * asked).sum()):
            side[:] = across / size
        else:
            _clearest(side, normal, direction, hand)
    across = side - (side * normal).sum() * normal
    size = np.sqrt((across * across).sum())
    if size < 1e-3:  # the side leads straight at it: another one
        _clearest(side, normal, direction, hand)
        across, size = side.copy(), 1.0
    offset += step / size * across
    length = np.sqrt((offset * offset).sum())
    if length > most:
        offset *= most / length


@compiled
def _clearest(side: FloatArray, normal: FloatArray, direction: FloatArray, hand: BoolArray) -> None:
    """Write the unit vector (3,) across the normal (3,), level or up, that points least at what else is near."""
    level = np.array((-normal[1], normal[0], 0.0))
    size = np.sqrt((level * level).sum())
    if size < 1e-6:
        level, size = np.array((0.0, 1.0, 0.0)), 1.0
    level /= size
    up = np.cross(normal, level)
    if up[2] < 0:
        up = -up
    least = np.inf
    for c in range(3):
        candidate = up if c == 0 else (level if c == 1 else -level)
        faced = 0.0
        for r in range(len(hand)):
            faced += max(0.0, (candidate * direction[r]).sum())
        if faced < least - 1e-9:
            least = faced
            side[:] = candidate
