import json
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import FlattenObservation
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from pretouch.cli import main
from pretouch.errors import ExperimentError
from pretouch_lab.learning import REACH
from pretouch_lab.learning.bench import episode
from pretouch_lab.learning.policy import Policy, load_policy
from pretouch_lab.learning.training import _policy

NONE = np.zeros((0, 2))


@pytest.fixture
def straight():
    """What a person would write: five times the way to the goal, which is the fourth to sixth number observed."""
    weight = np.zeros((6, 27))
    weight[range(3), range(3, 6)] = 5.0
    return Policy("by hand", np.zeros(27), np.ones(27), ((weight, np.zeros(6)),), NONE)


def test_numbers_by_hand():
    layers = (np.array([[1.0, 0.0], [0.0, 2.0]]), np.array([0.0, 1.0])), (np.array([[0.5, 3.0]]), np.array([0.1]))
    policy = Policy("", np.array([1.0, 0.0]), np.array([2.0, 1.0]), layers, NONE)
    found = policy.act({"b": np.array([-0.5]), "a": np.array([2.0])})  # a comes first
    assert found == pytest.approx([0.5 * np.tanh(0.5) + 0.1])
    assert policy.act({"a": np.array([2.0]), "b": np.array([1.0])}) == [1.0]


def test_it_acts_as_the_library_does_from_a_file_too(tmp_path):
    envs = VecNormalize(DummyVecEnv([lambda: FlattenObservation(gymnasium.make(REACH))]))
    envs.seed(1)
    model = PPO("MlpPolicy", envs, seed=0, device="cpu")
    seen, env = [], gymnasium.make(REACH)
    observation, _ = env.reset(seed=2)
    envs.reset()
    for move in np.random.default_rng(0).uniform(-1, 1, (8, 1, 6)):
        envs.step(move)
        observation, *_ = env.step(move[0])
        seen.append(observation)
    _policy(model, envs, "untrained", NONE).save(tmp_path / "policy.npz")
    policy = load_policy(tmp_path / "policy.npz")
    for observation in seen:
        flat = gymnasium.spaces.flatten(env.observation_space, observation)
        wanted, _ = model.predict(envs.normalize_obs(flat), deterministic=True)
        assert policy.act(observation) == pytest.approx(np.clip(wanted, -1, 1), abs=1e-5)


def test_what_is_no_policy_is_refused_and_not_run(tmp_path, straight):
    class Harm:
        def __reduce__(self):
            return print, ("harm",)

    file = tmp_path / "policy.npz"
    for write in (
        lambda: file.write_text("no archive"),
        lambda: np.savez(file, about="", mean=np.zeros(3)),
        lambda: np.savez(file, about=np.array([Harm()], dtype=object)),
        lambda: straight.save(file) or file.write_bytes(file.read_bytes()[:500]),
        lambda: Policy("", np.zeros(2), np.ones(2), straight.layers, NONE).save(file),
    ):
        write()
        with pytest.raises(ExperimentError, match=r"policy\.npz.*give one that `pretouch learn` wrote"):
            load_policy(file)
    with pytest.raises(ExperimentError, match="No such file"):
        load_policy(tmp_path / "gone.npz")


def test_an_episode_of_the_benchmark_is_measured(tmp_path, straight):
    straight.save(tmp_path / "p.npz")
    row = episode("shielded", "person +y", 4, tmp_path / "p.npz")
    assert (row["goals"], row["contacts"], row["contact"], row["true_peak_20ms_n"]) == (3, 0, False, 0.0)
    assert row["return"] > 15.0
    assert row["steps"] < 240
    assert episode("shielded", "person +y", 4, tmp_path / "p.npz") == row


@pytest.mark.slow
def test_one_command_trains_and_plays(tmp_path):
    words = ["learn", "--quick", "--steps", "1024", "--out", str(tmp_path / "run"), "--json", str(tmp_path / "n.json")]
    assert main(words) == 0
    found = json.loads((tmp_path / "n.json").read_text())
    cells = {(row["contender"], row["scenario"]): row for row in found["rows"]}
    assert {name for name, _ in cells} == {"alone", "alone, shielded", "shielded"}
    assert cells["shielded", "all"]["trials"] == 3
    for name, about in found["policies"].items():
        assert load_policy(Path(about["file"])).about.startswith("pretouch, 1024" if name == "shielded" else "blind")
        assert len(about["curve"]) <= 1
