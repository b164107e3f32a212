"""A person's hand that comes straight at the hand of a standing arm, from one of six directions."""

from dataclasses import dataclass

import numpy as np

from pretouch.control.posture import brought_to
from pretouch.perception.closest import closest_points
from pretouch.robot.model import RobotModel
from pretouch.sim.hand import HandGoal
from pretouch.sim.plant import Plant
from pretouch.sim.pushes import PALM
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import FloatArray

DIRECTIONS = {"plus-x": "+x", "minus-x": "-x", "plus-y": "+y", "minus-y": "-y", "plus-z": "+z", "minus-z": "-z"}
"""Where the hand comes from, seen from the robot's hand, base frame: as files are named, and as it is shown."""
PLACE_M = (0.4, 0.0, 0.5)
"""Where the arm stands: the middle of the paper's line [m]."""
_AIM_SPREAD_M = 0.02
"""The seed moves the aim by up to this across the way in [m]."""
_FAR_M = 1.0
"""Where the way begins, from the aim [m]."""
_CLEAR_M = 0.03
"""What the hand keeps from arm and floor [m]."""
_GRID_M = 0.005
"""How finely the way is looked at [m]."""
_SPEED_M_S = 0.1
_START_S = 3.0
"""When the hand sets out [s]: the force window is full and quiet."""
_FREE_N = 60.0
"""Force a person moves the free hand with [N]."""


@dataclass(frozen=True)
class Approach:
    """Moves the hand along a straight way at a constant speed, and holds it at the end."""

    start: FloatArray
    """(3,) [m]"""
    end: FloatArray
    """(3,) [m]"""

    @property
    def arrival(self) -> float:
        """When it is at the end [s]."""
        return _START_S + float(np.linalg.norm(self.end - self.start)) / _SPEED_M_S

    def goal(self, time: float, _hand: FloatArray, _plant: Plant) -> HandGoal:
        """Return where the hand should be at a time [s]."""
        done = np.clip((time - _START_S) / (self.arrival - _START_S), 0.0, 1.0)
        return HandGoal(self.start + done * (self.end - self.start), _FREE_N)


def outwards(direction: str) -> FloatArray:
    """Unit vector (3,) towards where the hand comes from."""
    shown = DIRECTIONS[direction]
    return np.eye(3)["xyz".index(shown[1])] * (1.0 if shown.startswith("+") else -1.0)


def approach(model: RobotModel, direction: str, seed: int) -> Approach:
    """Plan the way in: straight at the robot's hand, from 1.0 m off to 3 cm short of the arm.

    Where the floor or the arm itself leaves less room, the way begins 3 cm off them.
    """
    across = 1.0 - np.abs(outwards(direction))
    aside = _AIM_SPREAD_M * np.random.default_rng([seed, 62]).uniform(-1, 1, 3) * across
    kin = model.kinematics(brought_to(model, np.array(PLACE_M)))
    link = model.link_index("panda_hand")
    aim = kin.position[link] + kin.rotation[link] @ PALM + aside
    distances = np.arange(0.0, _FAR_M + _GRID_M / 2, _GRID_M)
    places = aim + distances[:, None] * outwards(direction)
    count = len(places)
    nearest = closest_points(
        kin,
        model.body,
        kin.position[model.ee],
        np.zeros(count, np.int64),
        places,
        np.tile(outwards(direction), (count, 1)),
    )
    room = np.minimum(nearest.body_distance, places[:, 2] - SceneSpec.floor_height) - HandSpec.radius
    free = room >= _CLEAR_M
    last = int(np.argmax(free))
    first = last + int(np.argmin(np.append(free[last:], False))) - 1
    return Approach(places[first], places[last])
