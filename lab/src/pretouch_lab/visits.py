"""A simulated person who holds a hand up beside the path, or into it."""

from dataclasses import dataclass

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sim.hand import FREE_N, HOME, LEAD_S, HandGoal, point_on_arm, robot_hand, way_round
from pretouch.sim.plant import Plant
from pretouch.types import FloatArray

_CLEAR_M = 0.4
"""Distance of the robot's hand at which a person dares to come in [m]."""


@dataclass(frozen=True)
class Visit:
    """A hand held at a place for a while."""

    arrive: float
    """[s]"""
    leave: float
    """[s]"""
    place: FloatArray
    """(3,) [m]"""


@dataclass
class Visitor:
    """Holds a hand up beside the path, then takes it away. Comes in while the robot's hand is elsewhere."""

    model: RobotModel
    visits: tuple[Visit, ...]

    def __post_init__(self) -> None:
        self._robot = robot_hand(self.model)
        self._inside = False

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Be at the place of the visit under way, or at home; come and go from the far side of the place."""
        for visit in self.visits:
            if visit.arrive - LEAD_S <= time < visit.leave + 1.0:
                outside = visit.place + np.array([0.0, np.sign(visit.place[1]) * 0.4, 0.0])
                palm = point_on_arm(plant, self._robot.link, self._robot.palm)
                clear = np.linalg.norm(palm - visit.place) > _CLEAR_M
                wanted = visit.arrive <= time < visit.leave
                self._inside = wanted and (self._inside or bool(clear))
                return HandGoal(visit.place if self._inside else way_round(hand, outside), FREE_N)
        return HandGoal(way_round(hand, HOME), FREE_N)
