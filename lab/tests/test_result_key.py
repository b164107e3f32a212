"""A run that goes on takes up no result that another source text made, of whatever engine."""

import shutil
from pathlib import Path

import pytest

import pretouch
import pretouch_lab
from pretouch.profiles import profile
from pretouch.source_digest import Sources
from pretouch_lab import result_key as keys
from pretouch_lab.benchmarks.avoidance import run as avoidance
from pretouch_lab.benchmarks.detection import campaign as detection
from pretouch_lab.benchmarks.localization import campaign as localization
from pretouch_lab.campaign import Request, trial_file
from pretouch_lab.registry import EXPERIMENTS
from pretouch_lab.result_key import result_key
from pretouch_lab.sweep.registry import MEASURES
from pretouch_lab.sweep.work import code


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """A copy of both packages."""
    ignored = shutil.ignore_patterns("__pycache__")
    for package in (pretouch, pretouch_lab):
        shutil.copytree(Path(package.__file__).parent, tmp_path / package.__name__, ignore=ignored)
    return tmp_path


def named(source: Path, patch: pytest.MonkeyPatch) -> dict[str, set[object]]:
    """Return what tells the results of each kind that are kept, if the source text is that of a folder."""
    sources, out = Sources(source / "pretouch", source / "pretouch_lab"), Path("out")
    patch.setattr(keys, "source_digest", lambda *made_by: sources.digest(*(one.__module__ for one in made_by)))
    keys._code.cache_clear()
    avoidance._key.cache_clear()
    benches = {
        "bench avoidance": avoidance.AvoidanceBench(out, quick=True).every(),
        "bench localization": localization.LocalizationBench(out, quick=True).every(),
    }
    bench = detection.DetectionBench(out, quick=True)
    for part in ("streams", "free", "contacts", "boards"):
        benches[f"bench detection {part}"] = getattr(bench, part)()
    found: dict[str, set[object]] = {name: {task.file for task in tasks} for name, tasks in benches.items()}
    found |= {f"sweep {name}": {code(name)} for name in MEASURES}
    for name in EXPERIMENTS:
        tasks = Request((name,), seeds=1, profiles=("paper", "pretouch")).trials()
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
    "pretouch/cholesky.py": ALL,
    "pretouch/events.py": ALL,
    "pretouch/sensing/skin.py": ALL,
    "pretouch/robot/data/panda.xml": ALL,
    "pretouch_lab/registry.py": set(),
    "pretouch_lab/weaknesses/creeping.py": {"reproduce creeping"},
    "pretouch_lab/benchmarks/avoidance/livelock.py": {"bench avoidance"},
    "pretouch_lab/sweep/streams.py": {"sweep free-motion", "sweep contacts"},
}
"""Kinds of results whose keys depend on a file."""


@pytest.mark.slow
def test_a_change_of_a_file_changes_all_keys_that_depend_on_it_and_no_other(source, monkeypatch):
    before = named(source, monkeypatch)
    assert all(before.values())
    for place, kinds in CHANGED.items():
        text = (source / place).read_bytes()
        (source / place).write_bytes(text + b"\n")
        after = named(source, monkeypatch)
        assert {name for name in before if before[name] != after[name]} == (before.keys() if kinds is ALL else kinds)
        (source / place).write_bytes(text)
    assert named(source, monkeypatch) == before


def test_other_parameters_and_libraries_have_another_key(monkeypatch):
    paper, blind = (result_key(code, profile=profile(name)) for name in ("paper", "blind"))
    assert len({paper, blind, result_key(code), result_key(code, named)}) == 4
    assert result_key(code, profile=profile("paper")) == paper
    monkeypatch.setattr(keys, "libraries", lambda: {"numpy": "0.1"})
    keys._code.cache_clear()
    assert result_key(code, profile=profile("paper")) != paper
