import runpy
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

EXAMPLE = Path(__file__).parents[3] / "examples" / "11_train_under_the_shield.py"


class RandomPolicy:
    """In place of the library's algorithm: nothing is learnt."""

    def __init__(self, policy, env, **options):
        self.env = env

    def learn(self, steps):
        self.env.reset()
        for _ in range(steps):
            self.env.step(self.env.action_space.sample())

    def save(self, place):
        Path(place).write_text("nothing")
        RandomPolicy.last = self

    @classmethod
    def load(cls, place, **options):
        assert Path(place).read_text() == "nothing"
        return cls.last

    def predict(self, observation, deterministic):
        assert set(observation) == set(self.env.observation_space)
        return self.env.action_space.sample(), None


def test_the_example_trains_saves_loads_and_plays(tmp_path, monkeypatch, capsys):
    if find_spec("stable_baselines3") is None:
        monkeypatch.setitem(sys.modules, "stable_baselines3", SimpleNamespace(PPO=RandomPolicy))
    place = tmp_path / "policy.zip"
    monkeypatch.setattr(sys, "argv", ["train", "--steps", "16", "--episodes", "1", "--file", str(place)])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    assert place.exists()
    trained, played = capsys.readouterr().out.splitlines()[-2:]
    assert trained == f"Trained for 16 steps: {place}"
    assert played.startswith("Trial 0: ")
