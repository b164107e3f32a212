"""Policies trained alone and under the shield, in the trials of the avoidance benchmark."""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

from pretouch.atomic_write import write_json
from pretouch.text_table import tabulated
from pretouch_lab.benchmarks.avoidance.scenario import scenarios
from pretouch_lab.benchmarks.bench import Bench, Found
from pretouch_lab.engine import Task, rows_of
from pretouch_lab.learning.policy import load_policy
from pretouch_lab.result_key import result_key
from pretouch_lab.rows import Row, cells_of, rounded
from pretouch_lab.tables import plain, with_spread

TRAINED = {"alone": False, "shielded": True}
"""Policies, and whether each was trained under the shield."""
PLAYED = {"alone": ("alone", False), "alone, shielded": ("alone", True), "shielded": ("shielded", True)}
"""Contenders: a policy, and whether it plays under the shield."""
_STEPS, _QUICK_STEPS = 300_000, 12_288
_STEP_COST, _EPISODE_COST = 6e-3, 2.0
"""Processor time of a step of training, and of an episode [s]."""
_SHIELD_COST = 1.15
_NOTE = (
    "Trials of `bench avoidance`, with the skin of seven units: median, 10-90 % below. goals: of three, held within"
    " 12 s. touched: episodes with a contact. contacts: in all. peak: of the true force, mean of 20 ms. limited: share"
    " of the steps in which something other than a limit of a joint kept the arm from what the policy asked."
)


@dataclass(frozen=True)
class LearningBench(Bench):
    """Training, and what the policies come to."""

    name: ClassVar[str] = "learn"
    shown_unfinished: ClassVar[bool] = True

    steps: int = field(default=0)
    """Of each training; 0: as many as are usual."""

    @property
    def wanted(self) -> int:
        """Steps of each training."""
        return self.steps or (_QUICK_STEPS if self.quick else _STEPS)

    def choices(self) -> Row:
        """See `Bench`; another number of steps makes other files."""
        return {"quick": self.quick, "seeds": self.seeds}

    def stages(self) -> list[list[Task]]:
        """Return the trainings, then the episodes."""
        from pretouch_lab.learning.environment import PEOPLE

        trained = [
            Task(self.policy(name), partial(_train, shield, self.wanted), self.wanted * _cost(shield))
            for name, shield in TRAINED.items()
        ]
        played = [
            Task(
                self.out / "trials" / f"{name}_{scene}_{seed:04d}_{self._key}.json".replace(" ", "-").replace(",", ""),
                partial(_play, name, scene, seed, self.policy(PLAYED[name][0])), _EPISODE_COST,
            )
            for name in PLAYED
            for scene in PEOPLE
            for seed in scenarios()[scene].seeds(self.seeds, self.quick)
        ]  # fmt: skip
        return [trained, played]

    def policy(self, name: str) -> Path:
        """Where a policy is kept."""
        return self.out / f"policy-{name}-{self._key}.npz"

    @property
    def _key(self) -> str:
        return f"{result_key(_train, _play)}-{self.wanted}"

    def found(self) -> Found | None:
        """See `Bench`."""
        rows = rows_of(self.stages()[1])
        if not rows:
            return None
        cells = cells_of(rows, ("contender", "scenario"), _MEASURES, ("contact",), ("contacts",))
        whole = cells_of([{**row, "scenario": "all"} for row in rows], ("contender", "scenario"), _MEASURES,
                         ("contact",), ("contacts",))  # fmt: skip
        policies = {name: _about(self.policy(name)) for name in TRAINED}
        json = {"about": self.about(), "policies": policies, "rows": [*cells, *whole]}
        said = "; ".join(f"{name}: {about['file']}, {about['about']}" for name, about in policies.items())
        table = tabulated("Reaching among people, learned", _COLUMNS, [*cells, *whole], _NOTE)
        return Found(json, [table], f"Policies: {said}.", [], "")


def _cost(shield: bool) -> float:
    return _STEP_COST * (_SHIELD_COST if shield else 1.0)


def _about(file: Path) -> Row:
    policy = load_policy(file)
    return {"file": str(file), "about": policy.about, "curve": policy.curve.round(2).tolist()}


def _train(shield: bool, steps: int, file: Path) -> None:
    """Train a policy, and keep it in a file."""
    from pretouch_lab.learning.training import train

    train(shield, steps, file)


def _play(name: str, scene: str, seed: int, policy: Path, file: Path) -> None:
    """Play an episode, and keep its row in a file."""
    write_json(episode(name, scene, seed, policy), file)


def episode(name: str, scene: str, seed: int, policy: Path) -> Row:
    """Play the trial of a scene and a seed with a policy from a file."""
    from pretouch_lab.learning.environment import ReachEnv

    acting, env = load_policy(policy), ReachEnv(PLAYED[name][1], scenes=(scene,))
    observation, info = env.reset(seed=seed)
    total, limits, over = 0.0, [], False
    while not over:
        observation, reward, terminated, truncated, info = env.step(acting.act(observation))
        total, over = total + reward, terminated or truncated
        limits.append(info["limited"])
    return {"contender": name, "scenario": scene, "seed": seed, **_measured(total, limits, info)}


def _measured(total: float, limits: list[str], info: dict[str, Any]) -> Row:
    kept = [each not in ("nothing", "joints") for each in limits]
    return {
        "return": rounded(total), "goals": info["goals"], "contacts": info["contacts"],
        "contact": info["contacts"] > 0, "true_peak_20ms_n": rounded(info["peak_force_n"]),
        "limited_share": rounded(sum(kept) / len(kept)), "steps": len(limits),
    }  # fmt: skip


_MEASURES = ("return", "goals", "true_peak_20ms_n", "limited_share", "steps")
_COLUMNS = (
    ("scenario", plain("scenario")),
    ("contender", plain("contender")),
    ("episodes", plain("trials")),
    ("return", lambda cell: with_spread(cell["return"], 1)),
    ("goals", lambda cell: with_spread(cell["goals"], 0)),
    ("touched", lambda cell: f"{100 * cell['contact_fraction']:.0f} %"),
    ("contacts", plain("contacts")),
    ("peak\n[N]", lambda cell: with_spread(cell["true_peak_20ms_n"], 1)),
    ("limited\n[%]", lambda cell: with_spread(cell["limited_share"], 0, 100.0)),
)
