"""One scene of the avoidance benchmark, turned step by step under a commander; and what a policy is told of it."""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pretouch import desired
from pretouch.desired import Desired, twist
from pretouch.loop import Options, turn
from pretouch.profiles import Profile
from pretouch.robot.model import RobotModel
from pretouch.traces import mean_over
from pretouch.types import ControlStep, FloatArray, RangeReadings, RangeStatus, RobotState
from pretouch_lab.bench.avoidance_scenes import Scenario, setting
from pretouch_lab.trial import Simulation

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
_MEAN_STEPS = 20
"""Physics steps that a peak force is the mean of, as in the benchmark: 20 ms."""
_CLEAR_M = 0.15
"""A goal is this far from what stands in the scene at the start."""
_AWAY_M = 0.2
"""And this far from where the end-effector is."""
_DRAWS = 1000


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


class Scene:
    """The arm of a scenario and a seed: the same errors, person and noise as the benchmark's trial of that seed."""

    def __init__(self, scenario: Scenario, profile: Profile, skin: str, seed: int) -> None:
        """Build it, and let the arm stand until contacts can be detected."""
        made = setting(replace(scenario, params={**scenario.params, "skin": skin}), profile, seed)
        setup = made.setup
        self._path, self._shape, self.model = setup.path, made.shape, setup.model
        self._arm = Simulation(setup)
        self._state = self._arm.controller.init(self._arm.plant.read())
        self._forces = np.zeros(_MEAN_STEPS - 1)
        self.contacts = 0
        """Times that something began to touch the arm."""
        self.peak_force = 0.0
        """Largest mean of the true force over 20 ms [N]."""
        self.mean_force = 0.0
        """Mean of the true force since `turn` was called last [N]."""
        self.robot: RobotState
        self.readings: RangeReadings
        self.step = self.turn(twist(self._arm.plant.time, np.zeros(3)), 1)
        for _ in range(profile.window.samples):
            self.turn(twist(self.step.stamp, np.zeros(3)), 1)

    @property
    def ee_position(self) -> FloatArray:
        """(3,) of the end-effector by the arm's sensors [m]."""
        return self.model.kinematics(self.robot.q).position[self.model.ee]

    def turn(self, asked: Desired, cycles: int) -> ControlStep:
        """Let control cycles pass under what is asked, and return the last step; what is observed is of after it."""
        options, arm = Options(desired=lambda: asked), self._arm
        for _ in range(cycles):
            cycle = turn(arm.controller, self._state, arm.plant, arm.skin, arm.clock.tick(), options)
            self._state, self.step = cycle.after, cycle.step
        self.robot, self.readings = cycle.inputs.robot, cycle.inputs.readings
        log, touches = arm.plant.take_log()
        forces = np.concatenate([self._forces, np.linalg.norm([force for _, force in log], axis=1)])
        self._forces = forces[1 - _MEAN_STEPS :]
        self.contacts += len(touches)
        self.peak_force = max(self.peak_force, float(mean_over(forces, _MEAN_STEPS).max()))
        self.mean_force = float(forces[_MEAN_STEPS - 1 :].mean())
        return self.step

    def goal(self, rng: np.random.Generator) -> FloatArray:
        """Draw a place (3,) [m] on the scenario's path, away from the hand and from what stands in its way."""
        shape = self._shape(self._arm.hand.position if self._arm.hand else np.zeros(3))
        for _ in range(_DRAWS):
            point = self._path.point(rng.uniform(0.0, self._path.length))
            if np.linalg.norm(point - self.ee_position) > _AWAY_M and shape.closest(point)[0] > _CLEAR_M:
                break
        return point
