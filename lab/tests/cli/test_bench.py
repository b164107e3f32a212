import json
from pathlib import Path

import pytest

from pretouch import cli
from pretouch_lab.benchmarks.bench import Bench
from pretouch_lab.benchmarks.detection import campaign
from pretouch_lab.cli import benchmarks
from pretouch_lab.cli.benchmarks import BenchOptions
from pretouch_lab.documents import begin_mark, end_mark


@pytest.fixture
def nothing_to_do(monkeypatch):
    monkeypatch.setattr(Bench, "every", lambda _: [])
    monkeypatch.setattr(Bench, "run", lambda *_: None)
    monkeypatch.setattr(campaign.DetectionBench, "rows", lambda _: campaign.Rows([], [], [], []))


def test_bench_detection_writes_numbers_figures_and_document(nothing_to_do, capsys, tmp_path):
    docs, out = tmp_path / "docs", tmp_path / "run"
    (docs / "results").mkdir(parents=True)
    (docs / "results" / "benchmarks.md").write_text(f"# Title\n{begin_mark('detection')}\n{end_mark('detection')}\n")
    given = ["bench", "detection", "--quick", "--out", str(out), "--docs", str(docs)]
    assert cli.main([*given, "--seeds", "development"]) == 0
    said = capsys.readouterr().out
    assert "nothing can be said of false alarms" in said
    assert json.loads((out / "results.json").read_text())["about"]["quick"] is True
    for name in ("curves", "missed"):
        assert (docs / "images" / f"bench-detection-{name}.png").stat().st_size > 1000
    assert "development seeds, quick run" in (docs / "results" / "benchmarks.md").read_text()
    assert cli.main(given) == 2
    assert "holds a run with seeds = 'development', not 'published': give another --out" in capsys.readouterr().err


def test_a_document_without_a_place_for_the_tables_is_refused_before_anything_is_run(capsys, tmp_path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "benchmarks.md").write_text("# Title\n")
    assert cli.main(["bench", "detection", "--out", str(tmp_path / "run"), "--docs", str(tmp_path)]) == 2
    assert "has no place for detection" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


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


def test_bench_both_says_which_goals_were_reached_and_writes_the_documents(nothing_measured, capsys, tmp_path):
    marks = "".join(f"{begin_mark(part)}\n{end_mark(part)}\n" for part in ("detection", "avoidance", "goals"))
    document = tmp_path / "results" / "benchmarks.md"
    document.parent.mkdir()
    document.write_text(marks)
    readme = tmp_path / "README.md"
    readme.write_text(f"# Title\n{begin_mark('front')}\n{end_mark('front')}\n")
    given = ["bench", "both", "--quick", "--seeds", "development", "--out", str(tmp_path / "run")]
    assert cli.main([*given, "--docs", str(tmp_path), "--readme", str(readme)]) == 0
    assert capsys.readouterr().out.count("not measured") == 14
    assert "detection quick, development seeds, avoidance quick" in document.read_text()
    assert "What happens when it touches something" in readme.read_text()


def test_bench_both_refuses_a_first_page_without_a_place_for_the_table(capsys, tmp_path):
    readme = tmp_path / "README.md"
    readme.write_text("# Title\n")
    assert cli.main(["bench", "both", "--out", str(tmp_path / "run"), "--readme", str(readme)]) == 2
    assert "has no place for front" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


def test_bench_localization_writes_numbers_and_its_document(monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(Bench, "every", lambda _: [])
    monkeypatch.setattr(Bench, "run", lambda bench, _: bench.open())
    docs, out = tmp_path / "docs", tmp_path / "run"
    document = docs / "results" / "localization.md"
    document.parent.mkdir(parents=True)
    document.write_text(f"# Title\n{begin_mark('localization')}\n{end_mark('localization')}\n")
    given = ["bench", "localization", "--quick", "--seeds", "development", "--out", str(out), "--docs", str(docs)]
    assert cli.main(given) == 0
    assert (out / "results.json").exists()
    assert "development seeds, quick run" in document.read_text()
    document.write_text("# Title\n")
    assert cli.main(given) == 2
