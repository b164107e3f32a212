import json

from pretouch import cli
from pretouch_lab.bench import shield
from pretouch_lab.cli import benchmarks


def test_a_benchmark_writes_numbers_and_tables_and_a_folder_of_others_is_refused(monkeypatch, capsys, tmp_path):
    cells = [({"filter": name, "commander": "tracking", "scene": "srdo"}, 1000) for name in ("paper", "none")]
    monkeypatch.setattr(shield, "plays", lambda *_: cells)
    measured = {"touches": [], "least_distance_m": 0.1, "steps": 9, "limit_violations": 0, "change_m2_s2": 0.0}
    monkeypatch.setattr(shield, "trial", lambda *_: measured | {"error_m2": 0.0})
    out, numbers = tmp_path / "run", tmp_path / "numbers.json"
    words = ["bench", "shield", "--quick", "--processes", "1", "--out", str(out), "--json", str(numbers)]
    assert cli.main([*words, "--seeds", "development"]) == 0
    assert "limits that hold for any command" in capsys.readouterr().out
    found = json.loads(numbers.read_text())
    assert found["about"]["quick"] is True
    assert [(row["filter"], row["steps"]) for row in found["rows"]] == [("paper", 9), ("none", 9)]
    assert "development seeds, quick run" in (out / "tables.md").read_text()
    assert len((out / "rows.jsonl").read_text().splitlines()) == 2
    assert cli.main(words) == 2
    assert "holds a run with seeds = 'development', not 'published': give another --out" in capsys.readouterr().err


def test_each_benchmark_plays_all_that_it_says(monkeypatch, tmp_path):
    counts = {}

    def played(_name, _trial, plays, out, _how):
        counts[out.name] = len(plays)
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmarks, "played", played)
    for name in ("localization", "detection", "avoidance"):
        assert cli.main(["bench", name, "--quick", "--out", str(tmp_path / name)]) == 130
    assert counts == {"localization": 6, "detection": 23, "avoidance": 123}
