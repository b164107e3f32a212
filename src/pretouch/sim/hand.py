"""A person's hand: a mass on a spring whose far end follows a script, with no more force than the script allows.

And a script by which it pushes the robot's hand.
"""

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.robot.model import RobotModel
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.types import FloatArray


class HandGoal(NamedTuple):
    """Where the arm of the person wants the hand to be."""

    position: FloatArray
    """(3,) base frame [m]."""
    force_max: float
    """Largest force the person pulls or pushes with [N]."""


class PersonArm(NamedTuple):
    """The arm behind the hand."""

    speed_max: float = 0.8
    """Limit of the goal's speed [m/s], so that the hand cannot jump into the robot."""
    stiffness: float = 2000.0
    """[N/m]"""
    damping: float = 60.0
    """[N s/m]"""


USUAL_ARM = PersonArm()
"""Of a person of whom nothing else is said."""


class HandScript(Protocol):
    """What a person means to do."""

    def goal(self, time: float, hand: FloatArray, plant: Plant) -> HandGoal:
        """Return the goal at a time [s], with the hand's position (3,) [m] and the arm for the person to look at."""
        ...


class Hand:
    """Drives the hand of a scene by a script. Its speed is limited, so it cannot jump into the arm."""

    def __init__(self, plant: Plant, script: HandScript, arm: PersonArm = USUAL_ARM) -> None:
        """Attach to a plant whose scene has a hand; `arm` is what moves it."""
        self._plant, self._script, self._arm, self._dt = plant, script, arm, plant.params.period_s
        body = plant.mj_model.body("hand")
        dof, data = int(plant.mj_model.body_dofadr[body.id]), plant.mj_data
        # views into the simulation's memory, taken once
        self._offset, self._velocity = data.qpos[dof : dof + 3], data.qvel[dof : dof + 3]
        self._force = data.qfrc_applied[dof : dof + 3]
        self._home = np.array(body.pos)
        self._goal = self._home.copy()
        plant.before_each_step(self._drive)

    @property
    def position(self) -> FloatArray:
        """Position of the hand (3,) [m], base frame."""
        return self._home + self._offset

    @property
    def velocity(self) -> FloatArray:
        """Velocity of the hand (3,) [m/s]."""
        return self._velocity.copy()

    def _drive(self, time: float) -> None:
        position = self.position
        goal = self._script.goal(time, position, self._plant)
        _pull(self._goal, self._force, goal, position, self._velocity, self._dt, self._arm)


@compiled
def _pull(
    last: FloatArray, force: FloatArray, goal: HandGoal, x: FloatArray, v: FloatArray, dt: float, arm: PersonArm
) -> None:
    """Move the spring's far end (3,) [m], which was at `last` a step before; write it and the force on the hand (3,).

    The force is in N; x [m] and v [m/s] (3,) are the hand's position and velocity.
    """
    at = last + _shortened(goal.position - last, arm.speed_max * dt)
    # never farther ahead than the largest force stretches the spring: a person who lets go pulls back at once
    at = x + _shortened(at - x, goal.force_max / arm.stiffness)
    pull = arm.stiffness * (at - x) + arm.damping * ((at - last) / dt - v)
    force[:], last[:] = _shortened(pull, goal.force_max), at


@kernel
def _shortened(vector: FloatArray, length: float) -> FloatArray:
    size = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    return vector if size <= length else vector * (length / size)


def point_on_arm(plant: Plant, link: int, offset: FloatArray) -> FloatArray:
    """Where a point fixed to a link, `offset` (3,) [m] in its frame, is now (3,) [m], base frame."""
    return plant.link_position[link] + plant.link_rotation[link] @ offset


HOME = np.array([1.2, 0.0, 0.8])
"""Where the person's hand rests [m]."""
_AISLE_X_M = 1.15
"""Plane in front of the Panda's reach in which a hand changes sides, so that it meets the arm only on purpose [m]."""
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
    """(3,) unit vector of the push in the frame of `RobotHand`: against the normal of a face, or nearly."""
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
        number, withdrawing = len(self.contacts), time < self._release + 1.0
        over = number == len(self.pushes)
        if not withdrawing and (over or time < self.pushes[number].start - LEAD_S):
            return HandGoal(way_round(hand, HOME), FREE_N)
        robot = self._robot
        palm = point_on_arm(plant, robot.link, robot.palm)
        if withdrawing:
            return HandGoal(palm - _STAND_OFF_M * self._direction, FREE_N)
        push = self.pushes[number]
        if self._touch is None:
            self._direction = point_on_arm(plant, robot.link, self._ahead_of_palm[number]) - palm
        if time < push.start:
            return HandGoal(way_round(hand, palm - _STAND_OFF_M * self._direction), FREE_N)
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
