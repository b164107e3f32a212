"""`pretouch/Reach-v0`: reach places one after the other where people come into the arm's way."""

from dataclasses import dataclass, field
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict

from pretouch.errors import ParameterError
from pretouch.profiles import profile
from pretouch.types import FloatArray
from pretouch_lab.bench.avoidance_scenes import Scenario, arm, scenarios, skin
from pretouch_lab.learning.scene import CYCLES, HELD, NEAR_M, ActionKind, Interface, Observation, Scene

PEOPLE = ("person -y", "person +y", "beside", "inside", "walking")
"""Scenes of the avoidance benchmark with people."""
SHIELDED = "pretouch"
ALONE = "blind:detect.f_base_n=10000:failure.force_timeout_s=1e6"
"""Limits of the joints alone: it knows nothing of what is near, no force is a contact, and it needs no estimate of one:
`blind` as it is stops near a singularity, for want of an estimate, and does not go on."""
SKINS = ("paper", "dense")
GOALS = 3
"""Goals held that end an episode."""
_TIME_S = 12.0
"""Longest episode."""


@dataclass(frozen=True)
class Reward:
    """What a step earns, with the shield and without."""

    progress_1_m: float = 10.0
    """For each metre nearer to the goal."""
    held: float = 5.0
    """For a goal held."""
    force_1_n: float = 0.01
    """Lost for each newton of the mean true contact force in the step."""
    bound_n: float = 140.0
    """Peak of the true force (mean of 20 ms) that ends an episode [N]: quasi-static limit of a hand (ISO/TS 15066)."""
    broken: float = 20.0
    """Lost where it is exceeded."""


@dataclass(frozen=True)
class _Choices:
    """What an environment is made with."""

    scenes: tuple[Scenario, ...]
    profile: str
    skin: str
    reward: Reward = field(default_factory=Reward)


class ReachEnv(gymnasium.Env):  # type: ignore[misc]  # not followed, see pyproject
    """A simulated Panda with a skin reaches three goals on the path of a scenario.

    `observation.Interface` tells what is observed, and what an action between -1 and 1 asks for. The action is stamped
    by the step it was observed at, and counts from the control cycle after it. `reset(seed=n)` gives the arm, person
    and noise of trial n of the benchmark; without a seed others are drawn. An episode is terminated by its third goal
    held or by too large a force, and truncated after 12 s. `info` has `contacts`, `peak_force_n`, `goals`, and of the
    last control cycle `limited` (`Limit`, by its value) and `share`.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # Gymnasium's
    render_mode = None

    def __init__(
        self, shield: bool = True, action: ActionKind = "twist", skin_name: str = "paper",
        scenes: tuple[str, ...] = PEOPLE, reward: Reward | None = None,
    ) -> None:  # fmt: skip
        """Make it; the first reset builds the arm.

        Args:
            shield: whether the controller is `pretouch`; else it has the limits of the joints alone.
            action: twist (6,) or joint_velocities (7,).
            skin_name: paper, seven units, or dense, 32.
            scenes: scenarios of `bench avoidance`, one of which is drawn for each episode.
            reward: what a step earns.
        """
        if action not in ("twist", "joint_velocities"):
            raise ParameterError(f"The action is {action!r}: choose twist or joint_velocities.")
        if skin_name not in SKINS:
            raise ParameterError(f"The skin is {skin_name!r}: choose from {', '.join(SKINS)}.")
        self._choices = _Choices(_found(scenes), SHIELDED if shield else ALONE, skin_name, reward or Reward())
        self.interface = Interface(arm(), len(skin(skin_name)), action)
        bounds = self.interface.bounds()
        self.observation_space = Dict({name: Box(*_float32(*pair)) for name, pair in bounds.items()})
        self.action_space = Box(-1.0, 1.0, self.interface.scale.shape, np.float32)
        self._scene: Scene | None = None
        self._goal, self._distance, self._begun = np.zeros(3), 0.0, 0.0
        self._goals = self._at_goal = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; `options` are not used."""
        super().reset(seed=seed)
        chosen = self._choices
        scenario = chosen.scenes[int(self.np_random.integers(len(chosen.scenes)))]
        number = int(self.np_random.integers(2**31)) if seed is None else seed
        self._scene = Scene(scenario, profile(chosen.profile), chosen.skin, number)
        self._begun, self._goals = self._scene.step.stamp, 0
        self._next_goal()
        return self._observed(), self._info()

    def step(self, action: FloatArray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Let a step pass; see the class."""
        scene, reward = self._running(), self._choices.reward
        before = self._distance
        scene.turn(self.interface.desired(scene.step.stamp, action), CYCLES)
        self._distance = float(np.linalg.norm(self._goal - scene.ee_position))
        earned = reward.progress_1_m * (before - self._distance) - reward.force_1_n * scene.mean_force
        self._at_goal = self._at_goal + 1 if self._distance < NEAR_M else 0
        if self._at_goal == HELD:
            earned += reward.held
            self._goals += 1
            self._next_goal()
        broken = scene.peak_force > reward.bound_n
        earned -= reward.broken * broken
        over = broken or self._goals == GOALS
        late = scene.step.stamp - self._begun > _TIME_S - 1e-6
        return self._observed(), float(earned), over, late and not over, self._info()

    def _running(self) -> Scene:
        if self._scene is None:
            raise ParameterError("The episode has not begun: call reset() before step().")
        return self._scene

    def _next_goal(self) -> None:
        scene = self._running()
        self._goal, self._at_goal = scene.goal(self.np_random), 0
        self._distance = float(np.linalg.norm(self._goal - scene.ee_position))

    def _observed(self) -> Observation:
        scene = self._running()
        return self.interface.observe(scene.robot, scene.readings, self._goal)

    def _info(self) -> dict[str, Any]:
        scene = self._running()
        limited = scene.step.limited
        return {
            "contacts": scene.contacts, "peak_force_n": scene.peak_force, "goals": self._goals,
            "limited": limited.by.value, "share": limited.share,
        }  # fmt: skip


def _found(names: tuple[str, ...]) -> tuple[Scenario, ...]:
    """Look scenarios up, in which there is something to reach."""
    known = {name: each for name, each in scenarios().items() if each.params["path"]["kind"] != "held"}
    if wrong := [name for name in names if name not in known]:
        raise ParameterError(f"There is nothing to reach in the scene {wrong[0]!r}: choose from {', '.join(known)}.")
    if not names:
        raise ParameterError(f"There are no scenes: choose from {', '.join(known)}.")
    return tuple(known[name] for name in names)


def _float32(low: FloatArray, high: FloatArray) -> tuple[Any, Any]:
    """Return bounds as Gymnasium takes them for 32-bit numbers."""
    return low.astype(np.float32), high.astype(np.float32)
