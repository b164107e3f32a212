"""A person's hand: a mass on a spring whose far end follows a script, with no more force than the script allows.

And a script by which it pushes the robot's hand.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from pretouch.robot.model import RobotModel
from pretouch.sim.physics import AIM, AT_HOME, END, POINT, RATE, SPEED, HandMemory
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.types import FloatArray

_NONE = np.zeros(3)


class HandGoal(NamedTuple):
    """Target that the person's arm moves the hand to."""

    position: FloatArray
    """(3,) from the point of the link, axes of the base frame [m]."""
    force_max: float
    """Largest force the person pulls or pushes with [N]."""
    link: int = 0
    """The world, or the link that the hand follows."""
    point: FloatArray = _NONE
    """(3,) where it is now in the link's frame [m]."""
    rate: FloatArray = _NONE
    """(3,) its velocity in that frame [m/s]."""
    way_round: bool = False
    """True if the hand goes there by `physics.way_round`."""
    until: float = -np.inf
    """Time until which the goal holds, if nothing touches before [s]."""


class PersonArm(NamedTuple):
    """The arm behind the hand."""

    speed_max: float = 0.8
    """Limit of the goal's speed [m/s], so that the hand cannot jump into the robot."""
    stiffness: float = 2000.0
    """[N/m]"""
    damping: float = 60.0
    """[N s/m]"""


USUAL_ARM = PersonArm()
"""Arm of a person without other parameters."""


class HandScript(Protocol):
    """Script of a simulated person."""

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return the goal at a time [s], with the hand's position (3,) [m] and the arm for the person to look at."""
        ...


class Hand:
    """Drives the hand of a scene by a script. Its speed is limited, so it cannot jump into the arm."""

    def __init__(self, plant: Plant, script: HandScript, arm: PersonArm = USUAL_ARM) -> None:
        """Attach to a plant whose scene has a hand; `arm` is what moves it."""
        self._plant, self._script = plant, script
        body = plant.mj_model.body("hand")
        dof, data = int(plant.mj_model.body_dofadr[body.id]), plant.mj_data
        own = slice(dof, dof + 3)
        places, numbers = np.zeros((5, 3)), np.array([0.0, 0.0, 0.0, 0.0, *arm])
        places[AT_HOME] = places[END] = body.pos
        # views into the simulation's memory, taken once
        views = data.qpos[own], data.qvel[own], data.qfrc_applied[own], data.xpos, data.xmat
        self._memory = plant.hand = HandMemory(*views, places, numbers)
        plant.before_each_step(self._drive)

    @property
    def position(self) -> FloatArray:
        """Position of the hand (3,) [m], base frame."""
        return np.asarray(self._memory.places[AT_HOME] + self._memory.position)

    def _drive(self, time: float) -> float:
        goal = self._script.goal(time, self.position, self._plant)
        places, numbers = self._memory.places, self._memory.numbers
        places[AIM], places[POINT], places[RATE] = goal.position, goal.point, goal.rate
        numbers[:SPEED] = goal.link, time, goal.force_max, goal.way_round
        return goal.until


def point_on_arm(plant: Plant, link: int, offset: FloatArray) -> FloatArray:
    """Return the position (3,) [m], base frame, of a point fixed to a link at `offset` (3,) [m] in its frame."""
    return plant.link_position[link] + plant.link_rotation[link] @ offset


HOME = np.array([1.2, 0.0, 0.8])
"""Where the person's hand rests [m]."""
_STAND_OFF_M = 0.5
_SPEED_M_S = 0.35
"""Speed of a reaching hand relative to the arm [m/s]."""
FREE_N = 60.0
"""Force a person moves the free hand with [N]."""
PALM = np.array([0.0, 0.0, 0.045])
"""Point of the robot's hand the person aims at, in its frame [m]."""
LEAD_S = 4.0
"""Time before a push or visit in which the person brings the hand to the side it will come from [s]."""
_PATIENCE_S = 5.0
"""Time after which a person who has not touched the arm gives up [s]."""


@dataclass(frozen=True)
class Push:
    """One push against a face of the robot's hand."""

    start: float
    """Time at which the person reaches for the arm [s]."""
    inwards: FloatArray
    """(3,) unit vector of the push in the frame of `RobotHand`: against the normal of a face, or nearly."""
    force: float
    """[N]"""
    duration: float
    """[s]"""


FACES = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])
"""Outward normals of the faces of the robot's hand that are pushed, in its frame: right, left, front."""


def against(face: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Draw the direction (3,) of a push against a face: its normal, each component off by up to a quarter."""
    inwards = 0.25 * rng.uniform(-1, 1, 3) - face
    return np.asarray(inwards / np.linalg.norm(inwards))


@dataclass(frozen=True, eq=False)
class RobotHand:
    """The robot's hand as a person sees it: x to the front, y to the right, z down in the ready posture."""

    link: int
    """Index of the link it is fixed to."""
    palm: FloatArray
    """(3,) point the person aims at, link frame [m]."""
    turn: FloatArray
    """(3, 3) rotation matrix: brings vectors of the hand's frame to the link's."""

    def beside(self, away: FloatArray) -> FloatArray:
        """Return a point (3,) [m] away from the palm by a vector (3,) [m] of the hand's frame, link frame."""
        return np.asarray(self.palm + self.turn @ away)


_FRONT_RIGHT_DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation from a hand's frame to the base frame, ready posture."""


def robot_hand(model: RobotModel) -> RobotHand:
    """Return what of an arm is pushed: a Franka's hand, or the middle of the outermost link that has a body."""
    franka = f"{model.description.name}_hand"
    if franka in model.links:
        return RobotHand(model.link_index(franka), PALM, np.eye(3))
    joints = model.moved_by[model.body.link].sum(axis=1)
    link = int(model.body.link[joints == joints.max()].max())
    own = model.body.of_links(np.array([link]))
    low = np.minimum(own.a, own.b) - own.radius[:, None]
    high = np.maximum(own.a, own.b) + own.radius[:, None]
    ready = model.kinematics(model.description.q_ready).rotation[link]
    return RobotHand(link, (low.min(axis=0) + high.max(axis=0)) / 2, ready.T @ _FRONT_RIGHT_DOWN)


@dataclass
class Pusher:
    """Brings the hand before a face of the robot's hand, follows it, pushes as planned, and goes home in between."""

    model: RobotModel
    pushes: tuple[Push, ...]
    contacts: list[tuple[float, float] | None] = field(default_factory=list)
    """(touch, release) [s] of each push so far, None for one that never touched."""

    def __post_init__(self) -> None:
        self._robot = robot_hand(self.model)
        self._ahead_of_palm = [self._robot.beside(push.inwards) for push in self.pushes]
        self._touch: float | None = None
        self._release = -np.inf
        self._direction = np.zeros(3)

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Reach for the arm from the push's start, push for its duration, withdraw the way it came.

        The direction follows the robot's hand as it turns until the touch, and stays from then on.
        """
        number, back = len(self.contacts), self._release + 1.0
        over = number == len(self.pushes)
        start = np.inf if over else self.pushes[number].start
        if time >= back and time < start - LEAD_S:
            return HandGoal(HOME, FREE_N, way_round=True, until=start - LEAD_S)
        robot = self._robot
        if time < back:
            return HandGoal(-_STAND_OFF_M * self._direction, FREE_N, robot.link, robot.palm, until=back)
        push, inwards = self.pushes[number], self._ahead_of_palm[number] - robot.palm
        before = robot.palm - _STAND_OFF_M * inwards
        if time < start:
            return HandGoal(_NONE, FREE_N, robot.link, before, way_round=True, until=start)
        if self._touch is None:
            self._direction = plant.link_rotation[robot.link] @ inwards
        self._watch(time, push, plant)
        ahead = min(_SPEED_M_S * (time - start) - _STAND_OFF_M, _STAND_OFF_M)
        if self._touch is not None or len(self.contacts) > number:
            return HandGoal(ahead * self._direction, push.force, robot.link, robot.palm)
        moving = ahead < _STAND_OFF_M
        until = start + (2.0 * _STAND_OFF_M / _SPEED_M_S if moving else _PATIENCE_S)
        rate = _SPEED_M_S * inwards if moving else _NONE
        return HandGoal(_NONE, push.force, robot.link, robot.palm + ahead * inwards, rate, until=until)

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
