"""What the simulated person does: pushes of the hand, and a hand held up beside the path."""

from dataclasses import dataclass, field

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sim.hand import USUAL_ARM, HandGoal, point_on_arm
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.types import FloatArray

_HOME = np.array([1.2, 0.0, 0.8])
_AISLE_X_M = 1.15
"""Plane in front of the arm's reach in which a hand changes sides, so that it meets the arm only on purpose [m]."""
_STAND_OFF_M = 0.5
_SPEED_M_S = 0.35
"""Speed of a reaching hand relative to the arm [m/s]."""
_FREE_N = 60.0
"""Force a person moves the free hand with [N]."""
PALM = np.array([0.0, 0.0, 0.045])
"""Point of the robot's hand the person aims at, in its frame [m]."""
_LEAD_S = 4.0
"""Time before a push or visit in which the person brings the hand to the side it will come from [s]."""
_PATIENCE_S = 5.0
"""Time after which a person who has not touched the arm gives up [s]."""

_CLEAR_M = 0.4
"""Distance of the robot's hand at which a person dares to come in [m]."""


def way_round(hand: FloatArray, goal: FloatArray) -> FloatArray:
    """Next point (3,) [m] on a way from hand to goal (3,) [m] that does not cross the arm."""
    x, y, z = hand.tolist()
    aside = abs(y - goal[1])
    if x < _AISLE_X_M - 0.1:
        return goal if aside < 0.35 else np.array([_AISLE_X_M, y, z])
    return np.array([_AISLE_X_M, goal[1], goal[2]]) if aside > 0.1 else goal


@dataclass(frozen=True)
class Push:
    """One push against a face of the robot's hand."""

    start: float
    """When the person reaches for the arm [s]."""
    inwards: FloatArray
    """(3,) unit vector of the push in the frame of the robot's hand: against the normal of a face, or nearly."""
    force: float
    """[N]"""
    duration: float
    """[s]"""


FACES = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""Outward normals of the faces of the robot's hand that are pushed, in its frame: right, left, front."""


def against(face: FloatArray, rng: np.random.Generator, tilt: float = 0.25) -> FloatArray:
    """Draw the direction (3,) of a push against a face: its normal, each component off by up to `tilt`."""
    inwards = tilt * rng.uniform(-1, 1, 3) - face
    return np.asarray(inwards / np.linalg.norm(inwards))


def hand_of(model: RobotModel) -> int:
    """Return the index of a Franka arm's hand, whose faces are pushed."""
    return model.link_index(f"{model.description.name}_hand")


@dataclass
class Pusher:
    """Brings the hand before a face of the robot's hand, follows it, pushes as planned, and goes home in between."""

    model: RobotModel
    pushes: tuple[Push, ...]
    contacts: list[tuple[float, float] | None] = field(default_factory=list)
    """(touch, release) [s] of each push so far, None for one that never touched."""

    def __post_init__(self) -> None:
        self._link = hand_of(self.model)
        self._touch: float | None = None
        self._release = -np.inf
        self._direction = np.zeros(3)

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Reach for the arm from the push's start, push for its duration, withdraw the way it came.

        The direction follows the robot's hand as it turns until the touch, and stays from then on.
        """
        number, withdrawing = len(self.contacts), time < self._release + 1.0
        over = number == len(self.pushes)
        if not withdrawing and (over or time < self.pushes[number].start - _LEAD_S):
            return HandGoal(way_round(hand, _HOME), _FREE_N)
        palm = point_on_arm(plant, self._link, PALM)
        if withdrawing:
            return HandGoal(palm - _STAND_OFF_M * self._direction, _FREE_N)
        push = self.pushes[number]
        if self._touch is None:
            self._direction = point_on_arm(plant, self._link, PALM + push.inwards) - palm
        if time < push.start:
            return HandGoal(way_round(hand, palm - _STAND_OFF_M * self._direction), _FREE_N)
        self._watch(time, push, plant)
        ahead = _SPEED_M_S * (time - push.start) - _STAND_OFF_M
        return HandGoal(palm + min(ahead, _STAND_OFF_M) * self._direction, push.force)

    def _watch(self, time: float, push: Push, plant: Plant) -> None:
        """Notice the touch, and end the push after its time or when the person loses patience."""
        if self._touch is None and np.linalg.norm(plant.true_force) > TOUCH_N:
            self._touch = time
        if self._touch is not None and time > self._touch + push.duration:
            self.contacts.append((self._touch, time))
            self._touch, self._release = None, time
        elif self._touch is None and time > push.start + _PATIENCE_S:
            self.contacts.append(None)
            self._release = time


class Holder(Pusher):
    """A person who keeps pushing at one place, with one force: a hand that only pushes on slides past the arm's."""

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Reach, push and withdraw as planned, but from the touch on stay on the line of the push through the palm."""
        planned = super().goal(time, hand, plant)
        if self._touch is None:
            return planned
        palm = point_on_arm(plant, self._link, PALM)
        # ahead by what stretches the person's arm to the planned force; what it takes to stay on the line comes on top
        ahead = (hand - palm) @ self._direction + planned.force_max / USUAL_ARM.stiffness
        return HandGoal(palm + ahead * self._direction, _FREE_N)


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
        self._link = hand_of(self.model)
        self._inside = False

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Be at the place of the visit under way, or at home; come and go from the far side of the place."""
        for visit in self.visits:
            if visit.arrive - _LEAD_S <= time < visit.leave + 1.0:
                outside = visit.place + np.array([0.0, np.sign(visit.place[1]) * 0.4, 0.0])
                clear = np.linalg.norm(point_on_arm(plant, self._link, PALM) - visit.place) > _CLEAR_M
                wanted = visit.arrive <= time < visit.leave
                self._inside = wanted and (self._inside or bool(clear))
                return HandGoal(visit.place if self._inside else way_round(hand, outside), _FREE_N)
        return HandGoal(way_round(hand, _HOME), _FREE_N)
