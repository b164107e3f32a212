"""Free motion: arms without contact, some with a bystander (`scenarios/free.toml`)."""

import numpy as np

from pretouch.types import FloatArray
from pretouch_lab.bench.scenes import ArmCell, path_of, plant_of, scenario, sensing_of
from pretouch_lab.bench.streams import AWAY, Alone, Prepare, Stream, record

_HAND_SIDE_M = 0.102
"""Extent of the arm's hand to the side of its origin [m]."""
_HAND_FRONT_M = 0.13
"""Extent of hand and wrist to the front [m]."""


def warm_up_s() -> float:
    """Return the time at the start in which no alarm counts [s]."""
    return float(scenario("free")["duration"]["warm_up_s"])


def free_stream(arm: ArmCell, seed: int) -> Stream:
    """Simulate an arm in free motion; it has a skin only if somebody is near."""
    sensing = None if arm.near == "nothing" else sensing_of(arm.sensing, seed)
    path, plant, radius = path_of(arm.path), plant_of(arm.kind), scenario("free")["near"]["radius_m"]
    what = Alone(path, arm.speed_m_s, plant, sensing, radius, seed, warm_up_s() + arm.counted_s, arm.world)
    return record(what, _bystander(arm, seed))


def _bystander(arm: ArmCell, seed: int) -> Prepare:
    """Return a function that places a bystander beside the path, standing or passing; the seed draws the place."""
    near, rng = scenario("free")["near"], np.random.default_rng([seed, 31])
    closest = rng.uniform(*near["gap_m"])
    side, off = rng.choice([-1.0, 1.0]), rng.uniform(-0.1, 0.1, 2)

    def place(gap_m: float) -> FloatArray:
        if arm.path == "line":
            return np.array([0.4 + _HAND_FRONT_M + gap_m + near["radius_m"], 2 * off[0], 0.5 + 0.5 * off[1]])
        out = side if arm.path == "circle" else 1.0
        return np.array([0.5 + off[0], out * (0.25 + _HAND_SIDE_M + gap_m + near["radius_m"]), 0.25 + off[1]])

    way = near["passing_from_m"] - closest
    there_s = way / near["passing_speed_m_s"]
    cycle_s = near["passing_wait_s"] + 2 * there_s

    def passing(time: float) -> FloatArray:
        since = time % cycle_s - near["passing_wait_s"]
        if since < 0:
            return AWAY
        part = since / there_s if since < there_s else 2.0 - since / there_s
        return place(near["passing_from_m"] - part * way)

    standing = AWAY if arm.near == "nothing" else place(closest)
    return lambda plant: passing if arm.near == "passing" else standing
