"""Training by proximal policy optimisation (PPO, Schulman et al. 2017) of Stable-Baselines3."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium.wrappers import FlattenObservation
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from pretouch.types import FloatArray
from pretouch_lab.learning import REACH
from pretouch_lab.learning.environment import ALONE, SHIELDED
from pretouch_lab.learning.policy import Policy

_ARMS = 4
"""Episodes under way at once; they take turns, for each of the two trainings has a processor."""
_STEPS = 128
"""Steps of each between two updates."""
_GAMMA = 0.95
"""A reward 1 s ahead counts a third: what is near is a second away, and progress is paid as it is made."""
_SEED = 1_000_000
"""Far from those of the benchmark's trials."""
_HIDDEN = (64, 64)
_SETTINGS: dict[str, Any] = {
    "n_steps": _STEPS,
    "batch_size": 64,
    "n_epochs": 10,
    "learning_rate": 7e-4,
    "gamma": _GAMMA,
    "gae_lambda": 0.95,
    "stats_window_size": 20,  # of the curve, not of the learning
    "policy_kwargs": {"net_arch": list(_HIDDEN), "log_std_init": -0.5},
}


def train(shield: bool, steps: int, file: Path) -> None:
    """Train a policy for so many steps, with the shield or without, and write it to a file."""
    torch.set_num_threads(1)
    envs = DummyVecEnv([lambda: Monitor(FlattenObservation(gymnasium.make(REACH, shield=shield)))] * _ARMS)
    normalised = VecNormalize(envs, gamma=_GAMMA)
    curve = _Curve()
    model = PPO("MlpPolicy", normalised, seed=_SEED, device="cpu", **_SETTINGS)
    model.learn(steps, callback=curve)
    about = f"{SHIELDED if shield else ALONE}, {model.num_timesteps} steps"
    _policy(model, normalised, about, np.array(curve.points).reshape(-1, 2)).save(file)


class _Curve(BaseCallback):  # type: ignore[misc]  # not followed, see pyproject
    """Keeps the mean return of the newest episodes at each update."""

    def __init__(self) -> None:
        super().__init__()
        self.points: list[tuple[int, float]] = []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        if episodes := self.model.ep_info_buffer:
            self.points.append((self.num_timesteps, float(np.mean([each["r"] for each in episodes]))))


def _policy(model: Any, normalised: Any, about: str, curve: FloatArray) -> Policy:
    """Take the network that acts out of what was trained."""
    actor = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    layers = tuple(
        (part.weight.detach().numpy().copy(), part.bias.detach().numpy().copy())
        for part in actor if isinstance(part, torch.nn.Linear)
    )  # fmt: skip
    seen = normalised.obs_rms
    return Policy(about, seen.mean, np.sqrt(seen.var + normalised.epsilon), layers, curve)
