"""How much likelier a contact is where something is near: the prior of the sequential test.

An object adds hypotheses, it takes none away: a force on the body's point nearest to it, away from it. How much they
weigh depends on how soon it may touch. What no unit sees, or a unit whose reading is too old to be an obstacle, adds
nothing, and all other contacts keep the weight they have without a skin.
"""

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import FloatArray, IntArray

MOST = 4
"""Objects that are taken into account, the nearest ones."""


@compiled
def nearness(distance: float, closing: float, near: float, horizon: float) -> float:
    """How soon an object may touch, from 0 (not near) to 1 (touches within `horizon` [s]).

    `distance` [m] is from the body's surface, `closing` [m/s] the speed at which it becomes less; a growing one counts
    as it is.
    """
    ahead = distance - max(closing, 0.0) * horizon
    return min(max(1.0 - ahead / near, 0.0), 1.0)


@compiled
def nearest_of(distance: FloatArray, most: int) -> IntArray:
    """Indices of the smallest distances (K,), at most so many, the nearest first."""
    return np.argsort(distance)[:most]
