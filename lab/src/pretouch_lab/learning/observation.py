"""What a policy is given and what it answers: the same numbers in the environment and on an arm."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch import desired
from pretouch.desired import Desired
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, RangeReadings, RangeStatus, RobotState

ActionKind = Literal["twist", "joint_velocities"]
Observation = dict[str, FloatArray]

CYCLES = 5
"""Control cycles of a step: 0.05 s, within which an action does not go stale."""
NEAR_M = 0.05
"""The end-effector is at its goal within this."""
HELD = 5
"""Steps at the goal after which it is held."""
SPEED_M_S = 0.3
"""Velocity of the end-effector that an action of 1 along an axis asks for: the paper's speed."""
TURN_RAD_S = 0.5
"""Angular velocity, likewise."""
_JOINT_SHARE = 0.25
"""Share of a joint's largest velocity that an action of 1 asks for."""
_SEEN_M = 1.0
"""What is farther than this changes nothing that an arm does soon; a unit that sees nothing reads as this."""
_MOST_M = 2.0
"""Beyond the reach of an arm and of what it is asked."""


@dataclass(frozen=True)
class Interface:
    """Observations and actions of an arm with a skin of K units."""

    model: RobotModel
    units: int
    """K."""
    action: ActionKind = "twist"

    def bounds(self) -> dict[str, tuple[FloatArray, FloatArray]]:
        """Return the lowest and the highest value of each part of an observation."""
        fast, far, model = 2.0 * self.model.description.qd_max, np.full(3, _MOST_M), self.model
        return {
            "ranges": (np.zeros(self.units), np.full(self.units, _SEEN_M)),
            "q": (model.q_min - 0.1, model.q_max + 0.1),  # an encoder's noise, and what gives way in a contact
            "qd": (-fast, fast),
            "ee": (-far, far),
            "goal": (-far, far),
        }

    def observe(self, robot: RobotState, readings: RangeReadings, goal: FloatArray) -> Observation:
        """Return what a policy is given.

        Args:
            robot: state of the arm.
            readings: of its K units.
            goal: (3,) where the end-effector is to be [m], base frame.

        Returns:
            `ranges` (K,) the newest distances [m], 1 where a unit sees nothing nearer; `q` (n,) [rad]; `qd` (n,)
            [rad/s]; `ee` (3,) position of the end-effector [m]; `goal` (3,) from there to the goal [m].
        """
        ee = self.model.kinematics(robot.q).position[self.model.ee]
        ranges = np.where(readings.status == RangeStatus.OK, readings.distance, _SEEN_M)
        parts = {"ranges": ranges, "q": robot.q, "qd": robot.qd, "ee": ee, "goal": goal - ee}
        return {name: np.clip(parts[name], low, high).astype(np.float32) for name, (low, high) in self.bounds().items()}

    @property
    def scale(self) -> FloatArray:
        """(6,) or (n,) what an action of 1 asks for [m/s, rad/s]."""
        if self.action == "twist":
            return np.repeat((SPEED_M_S, TURN_RAD_S), 3)
        return _JOINT_SHARE * self.model.description.qd_max

    def desired(self, stamp: float, action: FloatArray) -> Desired:
        """Return what an action between -1 and 1 asks for, by the clock of the steps [s]."""
        number = self.scale * np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        if self.action == "twist":
            return desired.twist(stamp, number[:3], number[3:])
        return desired.joint_velocities(stamp, number)
