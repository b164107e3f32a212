import json
from pathlib import Path

import pytest

from pretouch import cli
from pretouch_lab.benchmarks.bench import Bench
from pretouch_lab.benchmarks.detection import campaign
from pretouch_lab.cli import benchmarks
from pretouch_lab.cli.benchmarks import BenchOptions


@pytest.fixture
def nothing_to_do(monkeypatch):
    monkeypatch.setattr(Bench, "every", lambda _: [])
    monkeypatch.setattr(Bench, "run", lambda *_: None)
    monkeypatch.setattr(campaign.DetectionBench, "rows", lambda _: campaign.Rows([], [], []))


def test_bench_detection_writes_numbers_and_tables(nothing_to_do, capsys, tmp_path):
    out = tmp_path / "run"
    given = ["bench", "detection", "--quick", "--out", str(out)]
    assert cli.main([*given, "--seeds", "development"]) == 0
    said = capsys.readouterr().out
    assert "nothing can be said of false alarms" in said
    assert json.loads((out / "results.json").read_text())["about"]["quick"] is True
    assert "development seeds, quick run" in (out / "tables.md").read_text()
    assert cli.main(given) == 2
    assert "holds a run with seeds = 'development', not 'published': give another --out" in capsys.readouterr().err


@pytest.fixture
def nothing_measured(monkeypatch):
    def leaves_nothing(name):
        def run(command):
            about = {"bench": name, "quick": command.quick, "seeds": command.seeds}
            folder = Path(command.out)
            folder.mkdir(parents=True)
            results = {"about": about, "rows": [], "paired": [], "families": []}
            (folder / "results.json").write_text(json.dumps(results))

        return run

    for name in ("detection", "avoidance"):
        monkeypatch.setattr(benchmarks, name.capitalize(), type(name, (BenchOptions,), {"run": leaves_nothing(name)}))


def test_bench_both_says_which_goals_were_reached(nothing_measured, capsys, tmp_path):
    out = tmp_path / "run"
    assert cli.main(["bench", "both", "--quick", "--seeds", "development", "--out", str(out)]) == 0
    assert capsys.readouterr().out.count("not measured") == 14
    text = (out / "tables.md").read_text()
    assert "detection quick, development seeds, avoidance quick" in text
    assert "What happens when it touches something" in text


def test_bench_localization_writes_numbers_and_tables(monkeypatch, tmp_path):
    monkeypatch.setattr(Bench, "every", lambda _: [])
    monkeypatch.setattr(Bench, "run", lambda bench, _: bench.open())
    out = tmp_path / "run"
    assert cli.main(["bench", "localization", "--quick", "--seeds", "development", "--out", str(out)]) == 0
    assert (out / "results.json").exists()
    assert "development seeds, quick run" in (out / "tables.md").read_text()
