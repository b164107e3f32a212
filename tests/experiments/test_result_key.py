"""A run that goes on takes up no result that another source text made, of whatever engine."""

import shutil
from pathlib import Path

import pytest

import pretouch
from pretouch.experiments import result_key as keys
from pretouch.experiments.bench.avoidance import run as avoidance
from pretouch.experiments.bench.detection import campaign as detection
from pretouch.experiments.bench.localization import campaign as localization
from pretouch.experiments.campaign import Request, trial_file
from pretouch.experiments.registry import EXPERIMENTS
from pretouch.experiments.result_key import result_key
from pretouch.experiments.sweep.registry import MEASURES
from pretouch.experiments.sweep.work import code
from pretouch.params import profile
from pretouch.source_digest import Sources


@pytest.fixture
def package(tmp_path: Path) -> Path:
    ignored = shutil.ignore_patterns("__pycache__")
    return Path(shutil.copytree(Path(pretouch.__file__).parent, tmp_path / "pretouch", ignore=ignored))


def named(package: Path, patch: pytest.MonkeyPatch) -> dict[str, set[object]]:
    """Return what tells the results of each kind that are kept, if the source text is that of a folder."""
    sources, out = Sources(package), Path("out")
    patch.setattr(keys, "source_digest", lambda *made_by: sources.digest(*(one.__module__ for one in made_by)))
    keys._code.cache_clear()
    avoidance._key.cache_clear()
    benches = {
        "bench avoidance": avoidance.Request(quick=True).tasks(out),
        "bench localization": localization.Bench(out, quick=True).every(),
    }
    bench = detection.Bench(out, quick=True)
    for part in ("streams", "free", "contacts", "boards"):
        benches[f"bench detection {part}"] = getattr(bench, part)()
    found: dict[str, set[object]] = {name: {task.file for task in tasks} for name, tasks in benches.items()}
    found |= {f"sweep {name}": {code(name)} for name in MEASURES}
    for name in EXPERIMENTS:
        tasks = Request((name,), seeds=1, profiles=("paper", "pretouch")).tasks()
        found[f"reproduce {name}"] = {trial_file(out, *task) for task in tasks}
    return found


@pytest.fixture(autouse=True)
def as_before(monkeypatch: pytest.MonkeyPatch):
    yield
    monkeypatch.undo()
    keys._code.cache_clear()
    avoidance._key.cache_clear()


ALL = None
CHANGED = {
    "cholesky.py": ALL,
    "events.py": ALL,
    "sensing/skin.py": ALL,
    "robot/data/panda.xml": ALL,
    "experiments/registry.py": set(),
    "experiments/weaknesses/creeping.py": {"reproduce creeping"},
    "experiments/bench/avoidance/livelock.py": {"bench avoidance"},
    "experiments/sweep/trying.py": {"sweep ishigami"},
}
"""Kinds of results whose keys depend on a file."""


def test_a_change_of_a_file_changes_all_keys_that_depend_on_it_and_no_other(package, monkeypatch):
    before = named(package, monkeypatch)
    assert all(before.values())
    for place, kinds in CHANGED.items():
        text = (package / place).read_bytes()
        (package / place).write_bytes(text + b"\n")
        after = named(package, monkeypatch)
        assert {name for name in before if before[name] != after[name]} == (before.keys() if kinds is ALL else kinds)
        (package / place).write_bytes(text)
    assert named(package, monkeypatch) == before


def test_other_parameters_and_libraries_have_another_key(monkeypatch):
    paper, blind = (result_key(code, profile=profile(name)) for name in ("paper", "blind"))
    assert len({paper, blind, result_key(code), result_key(code, named)}) == 4
    assert result_key(code, profile=profile("paper")) == paper
    monkeypatch.setattr(keys, "libraries", lambda: {"numpy": "0.1"})
    keys._code.cache_clear()
    assert result_key(code, profile=profile("paper")) != paper
