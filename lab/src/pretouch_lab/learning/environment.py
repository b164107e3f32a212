"""`pretouch/Reach-v0`: reach goals one after the other while people enter the arm's path."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict

from pretouch import desired
from pretouch.desired import Desired
from pretouch.errors import ParameterError
from pretouch.loop import Options, turn
from pretouch.profiles import Profile, profile
from pretouch.robot.model import RobotModel
from pretouch.traces import mean_over
from pretouch.types import ControlStep, FloatArray, RangeReadings, RangeStatus, RobotState
from pretouch_lab.bench.avoidance_scenes import Scenario, arm, scenarios, setting, skin
from pretouch_lab.trial import SimulatedTrial

PEOPLE = ("person -y", "person +y", "beside", "inside", "walking")
"""Scenes of the avoidance benchmark with people."""
SHIELDED = "pretouch"
ALONE = "blind:detect.f_base_n=10000:failure.force_timeout_s=1e6"
"""Profile with the limits of the joints alone: it ignores obstacles, no force is a contact, and it needs no estimate of
the force. The profile `blind` stops near a singularity, where there is no estimate, and does not continue."""
SKINS = ("paper", "dense")
GOALS = 3
"""Number of reached goals that ends an episode."""
_TIME_S = 12.0
"""Duration of the longest episode [s]."""
ActionKind = Literal["twist", "joint_velocities"]
Observation = dict[str, FloatArray]

CYCLES = 5
"""Control cycles of a step: 0.05 s, shorter than the time after which an action is stale."""
NEAR_M = 0.05
"""Largest distance of the end-effector from its goal to be at the goal [m]."""
HELD = 5
"""Steps at the goal that count as reaching it."""
SPEED_M_S = 0.3
"""Velocity of the end-effector for an action of 1 along an axis [m/s]: the paper's speed."""
TURN_RAD_S = 0.5
"""Angular velocity for an action of 1 about an axis [rad/s]."""
_JOINT_SHARE = 0.25
"""Fraction of a joint's largest velocity for an action of 1."""
_SEEN_M = 1.0
"""Largest distance in an observation [m], and the value of a unit without a reading."""
_MOST_M = 2.0
"""Bound on positions in an observation [m], beyond the reach of the arm."""
_MEAN_STEPS = 20
"""Physics steps of the mean for a peak force, 20 ms as in the benchmark."""
_CLEAR_M = 0.15
"""Least distance of a goal from the obstacle [m]."""
_AWAY_M = 0.2
"""Least distance of a goal from the end-effector [m]."""
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
            "q": (model.q_min - 0.1, model.q_max + 0.1),  # room for encoder noise and yielding joints
            "qd": (-fast, fast),
            "ee": (-far, far),
            "goal": (-far, far),
        }

    def observe(self, robot: RobotState, readings: RangeReadings, goal: FloatArray) -> Observation:
        """Return the observation of a policy.

        Args:
            robot: state of the arm.
            readings: of its K units.
            goal: (3,) goal of the end-effector [m], base frame.

        Returns:
            `ranges` (K,) the newest distances [m], 1 for a unit without a nearer reading; `q` (n,) [rad]; `qd` (n,)
            [rad/s]; `ee` (3,) position of the end-effector [m]; `goal` (3,) from there to the goal [m].
        """
        ee = self.model.kinematics(robot.q).position[self.model.ee]
        ranges = np.where(readings.status == RangeStatus.OK, readings.distance, _SEEN_M)
        parts = {"ranges": ranges, "q": robot.q, "qd": robot.qd, "ee": ee, "goal": goal - ee}
        return {name: np.clip(parts[name], low, high).astype(np.float32) for name, (low, high) in self.bounds().items()}

    @property
    def scale(self) -> FloatArray:
        """(6,) or (n,) velocities for an action of 1 [m/s, rad/s]."""
        if self.action == "twist":
            return np.repeat((SPEED_M_S, TURN_RAD_S), 3)
        return _JOINT_SHARE * self.model.description.qd_max

    def desired(self, stamp: float, action: FloatArray) -> Desired:
        """Return the desired motion of an action between -1 and 1, stamped by the clock of the steps [s]."""
        number = self.scale * np.clip(np.asarray(action, dtype=np.float64), -1.0, 1.0)
        if self.action == "twist":
            return desired.twist(stamp, number[:3], number[3:])
        return desired.joint_velocities(stamp, number)


class ReachScene:
    """The arm of a scenario and a seed, with the errors, person and noise of the benchmark's trial of that seed."""

    def __init__(self, scenario: Scenario, profile: Profile, skin_name: str, seed: int) -> None:
        """Build the arm, and let it stand until the force window is full."""
        scene = setting(replace(scenario, params={**scenario.params, "skin": skin_name}), profile, seed)
        setup = scene.setup
        if not profile.perception:  # the policy reads units that the controller does not
            setup = replace(setup, skin=skin(skin_name), believed=None)
        self._path, self._shape, self.model = setup.path, scene.shape, setup.model
        self._arm = SimulatedTrial(setup)
        self._state = self._arm.controller.init(self._arm.plant.read())
        self._forces = np.zeros(_MEAN_STEPS - 1)
        self.contacts = 0
        """Number of contacts with the arm so far."""
        self.peak_force = 0.0
        """Largest mean of the true force over 20 ms [N]."""
        self.mean_force = 0.0
        """Mean of the true force in the last `turn` [N]."""
        self.robot: RobotState
        self.readings: RangeReadings
        self.step = self.turn(desired.twist(self._arm.plant.time, np.zeros(3)), 1)
        for _ in range(profile.window.samples):
            self.turn(desired.twist(self.step.stamp, np.zeros(3)), 1)

    @property
    def ee_position(self) -> FloatArray:
        """(3,) of the end-effector by the arm's sensors [m]."""
        return self.model.kinematics(self.robot.q).position[self.model.ee]

    def turn(self, target: Desired, cycles: int) -> ControlStep:
        """Run control cycles with a desired motion, and return the last step; robot and readings are from after it."""
        options, arm = Options(desired=lambda: target), self._arm
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
        """Draw a goal (3,) [m] on the scenario's path, away from the end-effector and from the obstacle."""
        shape = self._shape(self._arm.hand.position if self._arm.hand else np.zeros(3))
        for _ in range(_DRAWS):
            point = self._path.point(rng.uniform(0.0, self._path.length))
            if np.linalg.norm(point - self.ee_position) > _AWAY_M and shape.closest(point)[0] > _CLEAR_M:
                break
        return point


@dataclass(frozen=True)
class Reward:
    """Reward of a step, with the shield and without."""

    progress_1_m: float = 10.0
    """Reward for each metre nearer to the goal."""
    goal: float = 5.0
    """Reward for a reached goal."""
    force_1_n: float = 0.01
    """Penalty for each newton of the mean true contact force in the step."""
    bound_n: float = 140.0
    """Peak of the true force (mean of 20 ms) that ends an episode [N]: quasi-static limit of a hand (ISO/TS 15066)."""
    broken: float = 20.0
    """Penalty for a larger peak."""


class ReachEnv(gymnasium.Env):  # type: ignore[misc]  # not followed, see pyproject
    """A simulated Panda with a skin reaches three goals on the path of a scenario.

    `Interface` describes observations, and the motion of an action between -1 and 1. An action has the stamp of the
    step of its observation, and acts from the next control cycle on. `reset(seed=n)` gives the arm, person and noise of
    trial n of the benchmark; without a seed they are random. The third goal or too large a force terminates an episode;
    12 s truncate it. `info` has `contacts`, `peak_force_n`, `goals`, and from the last control cycle `limited` (value
    of `Limit`) and `share`.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # Gymnasium's
    render_mode = None

    def __init__(
        self,
        shield: bool = True,
        action: ActionKind = "twist",
        skin_name: str = "paper",
        scenes: tuple[str, ...] = PEOPLE,
        reward: Reward | None = None,
    ) -> None:
        """Prepare the environment; the first reset builds the arm.

        Args:
            shield: True for the controller `pretouch`, False for the limits of the joints alone.
            action: twist (6,) or joint_velocities (7,).
            skin_name: paper, seven units, or dense, 32.
            scenes: scenarios of `bench avoidance`; each episode draws one.
            reward: reward of a step.
        """
        if action not in ("twist", "joint_velocities"):
            raise ParameterError(f"The action is {action!r}: choose twist or joint_velocities.")
        if skin_name not in SKINS:
            raise ParameterError(f"The skin is {skin_name!r}: choose from {', '.join(SKINS)}.")
        paths = {name: each for name, each in scenarios().items() if each.params["path"]["kind"] != "held"}
        if wrong := [name for name in scenes or ("",) if name not in paths]:
            raise ParameterError(
                f"There is nothing to reach in the scene {wrong[0]!r}: choose from {', '.join(paths)}."
            )
        self._scenes = [paths[name] for name in scenes]
        self._profile, self._skin = profile(SHIELDED if shield else ALONE), skin_name
        self._reward = reward or Reward()
        self.interface = Interface(arm(), len(skin(skin_name)), action)
        bounds = self.interface.bounds()
        self.observation_space = Dict({name: Box(*map(np.float32, pair)) for name, pair in bounds.items()})
        self.action_space = Box(-1.0, 1.0, self.interface.scale.shape, np.float32)
        self._scene: ReachScene | None = None
        self._goal, self._distance, self._begun = np.zeros(3), 0.0, 0.0
        self._goals = self._at_goal = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; `options` are not used."""
        super().reset(seed=seed)
        scenario = self._scenes[int(self.np_random.integers(len(self._scenes)))]
        number = int(self.np_random.integers(2**31)) if seed is None else seed
        self._scene = ReachScene(scenario, self._profile, self._skin, number)
        self._begun, self._goals = self._scene.step.stamp, 0
        self._next_goal(self._scene)
        return self._seen(self._scene)

    def step(self, action: FloatArray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Run a step; see the class."""
        scene, reward = self._scene, self._reward
        if scene is None:
            raise ParameterError("The episode has not begun: call reset() before step().")
        before = self._distance
        scene.turn(self.interface.desired(scene.step.stamp, action), CYCLES)
        self._distance = float(np.linalg.norm(self._goal - scene.ee_position))
        earned = reward.progress_1_m * (before - self._distance) - reward.force_1_n * scene.mean_force
        self._at_goal = self._at_goal + 1 if self._distance < NEAR_M else 0
        if self._at_goal == HELD:
            earned += reward.goal
            self._goals += 1
            self._next_goal(scene)
        broken = scene.peak_force > reward.bound_n
        earned -= reward.broken * broken
        over = broken or self._goals == GOALS
        late = scene.step.stamp - self._begun > _TIME_S - 1e-6
        observation, info = self._seen(scene)
        return observation, float(earned), over, late and not over, info

    def _next_goal(self, scene: ReachScene) -> None:
        self._goal, self._at_goal = scene.goal(self.np_random), 0
        self._distance = float(np.linalg.norm(self._goal - scene.ee_position))

    def _seen(self, scene: ReachScene) -> tuple[Observation, dict[str, Any]]:
        limited = scene.step.limited
        return self.interface.observe(scene.robot, scene.readings, self._goal), {
            "contacts": scene.contacts,
            "peak_force_n": scene.peak_force,
            "goals": self._goals,
            "limited": limited.by.value,
            "share": limited.share,
        }
