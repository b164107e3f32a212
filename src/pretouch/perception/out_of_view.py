"""Points from which the arm has carried their unit's beam away: no reading says whether they are still there."""

import math

import numpy as np

from pretouch.compiled import compiled
from pretouch.groups import Kinematics, Sensors, SkinArrays
from pretouch.perception.obstacles import pose_into
from pretouch.types import BoolArray, FloatArray

_ON_AXIS = math.cos(math.radians(0.5))
"""A target may be anywhere in its cone, though eq. 1 puts it on the axis: it may leave the cone as soon as that is
carried on. Half a degree is more than an arm at rest turns."""


@compiled
def looks_at(kin: Kinematics, skin: SkinArrays, k: int, point: FloatArray) -> bool:
    """Whether the beam of unit k still goes to a point (3,)."""
    position, rotation, link = np.empty(3), np.empty((3, 3)), skin.link[k]
    pose_into(kin.position[link], kin.rotation[link], skin.T_link_sensor[k], position, rotation)
    return _on_axis(position, rotation, point) >= 0


@compiled
def give_up(
    point: FloatArray, seen: FloatArray, sensors: Sensors, told: BoolArray, distance: FloatArray, until: float
) -> None:  # fmt: skip
    """Give up each point (K, 3) last `seen` (K,) before `until` [s] through whose place its unit now looks.

    `told` (K,) are units with a new reading that tells something, `distance` (K,) [m] what they show, NaN for nothing.
    """
    for k in range(len(seen)):
        if told[k] and seen[k] < until:
            away = _on_axis(sensors.position[k], sensors.rotation[k], point[k])
            # what is nearer may hide the point: such a reading says nothing about it
            if away >= 0 and not distance[k] < away:
                seen[k] = -np.inf


@compiled
def _on_axis(position: FloatArray, rotation: FloatArray, point: FloatArray) -> float:
    """Distance [m] of a point (3,) from a sensor on whose axis it lies, -1 if it does not, or is NaN."""
    along, away2 = 0.0, 0.0
    for i in range(3):
        to = point[i] - position[i]
        along += to * rotation[i, 2]
        away2 += to * to
    away = np.sqrt(away2)
    return away if along >= _ON_AXIS * away else -1.0
