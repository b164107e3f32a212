"""For how long something near has kept the arm from its path."""

from pretouch.compiled import compiled
from pretouch.types import BoolArray, FloatArray

_BLOCKED, _FREE = 0.5, 0.8
"""Part of the speed asked for below which the path is blocked, and from which on it is clear."""


@compiled
def time_blocked(
    before: float, asked: FloatArray, moving: FloatArray, direction: FloatArray, limit: FloatArray, hand: BoolArray,
    period: float,
) -> float:  # fmt: skip
    """Return for how long the path has been blocked [s], one period after `before` [s].

    It is blocked while something near the hand takes a part of the velocity asked for and less than half of that speed
    is left, and clear from 80 % of it on. Between both the time neither grows nor ends.

    Args:
        before: the time so far [s].
        asked: (3,) velocity asked of the end-effector [m/s].
        moving: (3,) what it moves with [m/s].
        direction: (R, 3) from the body to what restricts it.
        limit: (R,) what approach is allowed [m/s].
        hand: (R,) whether it is the hand that is near.
        period: control period [s].
    """
    wanted2 = (asked * asked).sum()
    # share of the velocity asked for that is left along it; an arm asked to stand, below 1 mm/s, is not blocked
    progress = (asked * moving).sum() / wanted2 if wanted2 > 1e-6 else 1.0
    if progress < _BLOCKED:
        for r in range(len(limit)):
            # the hand's points are taken to move as its origin: what its turning adds is left out
            if hand[r] and (asked * direction[r]).sum() - limit[r] > 0.0:
                return before + period
    # slow without such a row, by the joint box or at a singularity: the time waits, for nothing near blocks the path
    return before if progress < _FREE else 0.0
