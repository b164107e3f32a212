"""One scene of the avoidance benchmark, turned step by step under a commander."""

from dataclasses import replace

import numpy as np

from pretouch.controller import Controller
from pretouch.desired import Desired, twist
from pretouch.loop import Options, turn
from pretouch.profiles import Profile
from pretouch.robot.postures import brought_to
from pretouch.sim.hand import Hand
from pretouch.sim.plant import Plant, PlantClock
from pretouch.sim.range_finder import RangeFinders
from pretouch.sim.scene import fixtures
from pretouch.traces import mean_over
from pretouch.types import ControlStep, FloatArray, RangeReadings, RobotState
from pretouch_lab.benchmarks.avoidance.scenario import Scenario
from pretouch_lab.benchmarks.avoidance.setting import setting
from pretouch_lab.trial import SETTLE_S

_MEAN_STEPS = 20
"""Physics steps that a peak force is the mean of, as in the benchmark: 20 ms."""
_CLEAR_M = 0.15
"""A goal is this far from what stands in the scene at the start."""
_AWAY_M = 0.2
"""And this far from where the end-effector is."""
_DRAWS = 1000


class Scene:
    """The arm of a scenario and a seed: the same errors, person and noise as the benchmark's trial of that seed."""

    def __init__(self, scenario: Scenario, profile: Profile, skin: str, seed: int) -> None:
        """Build it, and let the arm stand until contacts can be detected."""
        made = setting(replace(scenario, params={**scenario.params, "skin": skin}), profile, seed)
        setup = made.setup
        self._path, self._shape, self.model = setup.path, made.shape, setup.model
        self._plant = Plant(setup.model, setup.scene, setup.plant, brought_to(setup.model, setup.path.point(0.0)), seed)
        self._units = RangeFinders(self._plant, setup.skin, setup.ranging, seed)
        self._hand = Hand(self._plant, setup.hand, setup.person) if setup.hand else None
        known = setup.skin if setup.believed is None else setup.believed
        self._controller = Controller(setup.model, known, fixtures(setup.scene), setup.path, profile)
        self._clock = PlantClock(self._plant, profile.task.control_period_s)
        self._plant.advance(SETTLE_S)
        self._state = self._controller.init(self._plant.read())
        self._forces = np.zeros(_MEAN_STEPS - 1)
        self.contacts = 0
        """Times that something began to touch the arm."""
        self.peak_force = 0.0
        """Largest mean of the true force over 20 ms [N]."""
        self.mean_force = 0.0
        """Mean of the true force since `turn` was called last [N]."""
        self.robot: RobotState
        self.readings: RangeReadings
        self.step = self.turn(twist(self._plant.time, np.zeros(3)), 1)
        for _ in range(profile.window.samples):
            self.turn(twist(self.step.stamp, np.zeros(3)), 1)

    @property
    def ee_position(self) -> FloatArray:
        """(3,) of the end-effector by the arm's sensors [m]."""
        return self.model.kinematics(self.robot.q).position[self.model.ee]

    def turn(self, asked: Desired, cycles: int) -> ControlStep:
        """Let control cycles pass under what is asked, and return the last step; what is observed is of after it."""
        options = Options(desired=lambda: asked)
        for _ in range(cycles):
            cycle = turn(self._controller, self._state, self._plant, self._units, self._clock.tick(), options)
            self._state, self.step = cycle.after, cycle.step
        self.robot, self.readings = cycle.inputs.robot, cycle.inputs.readings
        log, touches = self._plant.take_log()
        forces = np.concatenate([self._forces, np.linalg.norm([force for _, force in log], axis=1)])
        self._forces = forces[1 - _MEAN_STEPS :]
        self.contacts += len(touches)
        self.peak_force = max(self.peak_force, float(mean_over(forces, _MEAN_STEPS).max()))
        self.mean_force = float(forces[_MEAN_STEPS - 1 :].mean())
        return self.step

    def goal(self, rng: np.random.Generator) -> FloatArray:
        """Draw a place (3,) [m] on the scenario's path, away from the hand and from what stands in its way."""
        shape = self._shape(self._hand.position if self._hand else np.zeros(3))
        for _ in range(_DRAWS):
            point = self._path.point(rng.uniform(0.0, self._path.length))
            if np.linalg.norm(point - self.ee_position) > _AWAY_M and shape.closest(point)[0] > _CLEAR_M:
                break
        return point
