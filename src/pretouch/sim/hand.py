"""A person's hand: a mass on a spring whose far end follows a script, with no more force than the script allows."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.sim.plant import Plant
from pretouch.types import FloatArray


@dataclass(frozen=True, slots=True)
class HandGoal:
    """Where the arm of the person wants the hand to be."""

    position: FloatArray
    """(3,) base frame [m]."""
    force_max: float
    """Largest force the person pulls or pushes with [N]."""


@dataclass(frozen=True, slots=True)
class PersonArm:
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
        self._plant, self._script = plant, script
        self._moved_by = plant.params.period_s, _Arm(arm.speed_max, arm.stiffness, arm.damping)
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
        self._goal, self._force[:] = _spring(
            self._goal, _Goal(goal.position, goal.force_max), position, self._velocity, *self._moved_by
        )


class _Goal(NamedTuple):
    """As of `HandGoal`."""

    position: FloatArray
    force_max: float


class _Arm(NamedTuple):
    """As of `PersonArm`."""

    speed_max: float
    stiffness: float
    damping: float


@compiled
def _spring(
    last: FloatArray, goal: _Goal, x: FloatArray, v: FloatArray, dt: float, arm: _Arm
) -> tuple[FloatArray, FloatArray]:
    """Move the spring's far end (3,) [m], which was at `last` a step before, and return it with the force on the hand.

    The force is (3,) [N]; x [m] and v [m/s] (3,) are the hand's position and velocity.
    """
    at = last + _shortened(goal.position - last, arm.speed_max * dt)
    # never farther ahead than the largest force stretches the spring: a person who lets go pulls back at once
    at = x + _shortened(at - x, goal.force_max / arm.stiffness)
    force = arm.stiffness * (at - x) + arm.damping * ((at - last) / dt - v)
    return at, _shortened(force, goal.force_max)


@kernel
def _shortened(vector: FloatArray, length: float) -> FloatArray:
    size = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    return vector if size <= length else vector * (length / size)


def point_on_arm(plant: Plant, link: int, offset: FloatArray) -> FloatArray:
    """Where a point fixed to a link, `offset` (3,) [m] in its frame, is now (3,) [m], base frame."""
    return plant.link_position[link] + plant.link_rotation[link] @ offset
