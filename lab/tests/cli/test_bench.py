import json

import pytest

from pretouch import cli
from pretouch_lab.benchmarks.bench import Bench
from pretouch_lab.benchmarks.detection import campaign
from pretouch_lab.cli import benchmarks


@pytest.mark.parametrize(
    ("name", "words"), [("detection", "nothing can be said of false alarms"), ("localization", "Written: ")]
)
def test_a_benchmark_writes_numbers_and_tables(monkeypatch, capsys, tmp_path, name, words):
    monkeypatch.setattr(Bench, "every", lambda _: [])
    monkeypatch.setattr(Bench, "run", lambda *_: None)
    monkeypatch.setattr(campaign.DetectionBench, "rows", lambda _: campaign.Rows([], [], []))
    out = tmp_path / "run"
    given = ["bench", name, "--quick", "--out", str(out)]
    assert cli.main([*given, "--seeds", "development"]) == 0
    assert words in capsys.readouterr().out
    assert json.loads((out / "results.json").read_text())["about"]["quick"] is True
    assert "development seeds, quick run" in (out / "tables.md").read_text()
    assert cli.main(given) == 2
    assert "holds a run with seeds = 'development', not 'published': give another --out" in capsys.readouterr().err


def test_bench_both_says_which_goals_were_reached(monkeypatch, capsys, tmp_path):
    def leave_nothing(bench, _json):
        bench.out.mkdir(parents=True)
        nothing = {"about": bench.about(), "rows": [], "paired": [], "families": []}
        (bench.out / "results.json").write_text(json.dumps(nothing))

    monkeypatch.setattr(benchmarks, "run_bench", leave_nothing)
    out = tmp_path / "run"
    assert cli.main(["bench", "both", "--quick", "--seeds", "development", "--out", str(out)]) == 0
    assert capsys.readouterr().out.count("not measured") == 14
    text = (out / "tables.md").read_text()
    assert "detection quick, development seeds, avoidance quick" in text
    assert "What happens when it touches something" in text
