import csv
import json

from lab.tests.sweep.made import register, value

from pretouch import cli


def test_a_sweep_shows_and_writes_what_it_says_and_is_not_played_twice(capsys, tmp_path, monkeypatch):
    register(monkeypatch)
    vary, out = ("--vary", "scene.x1=-3:3", "--vary", "scene.x2=-3:3"), ("--processes", "1", "--out", str(tmp_path))
    args = ("ishigami", *vary, "--samples", "4", "--arms", "1", *out)
    assert cli.main(["sweep", *args]) == 0
    said = capsys.readouterr()
    for words in ("scene.x1", "scene.x2", "4 of 4 blocks have it"):
        assert words in said.out
    assert (tmp_path / "ishigami.png").stat().st_size > 1000
    header, *rows = csv.reader((tmp_path / "ishigami.csv").read_text().splitlines())
    assert header == ["scene.x1", "scene.x2", "seed", "value"]
    assert len(rows) == 16
    assert all(float(found) == value(float(x1), float(x2), 0.0) for x1, x2, _, found in rows)
    played = (tmp_path / "rows.jsonl").read_text()
    numbers = tmp_path / "numbers.json"
    assert cli.main(["sweep", *args, "--json", str(numbers)]) == 0
    assert json.loads(numbers.read_text())["metrics"]["value"]["points"] == 4
    assert (tmp_path / "rows.jsonl").read_text() == played
    assert cli.main(["sweep", *args, "--samples", "8"]) == 0
    assert len((tmp_path / "rows.jsonl").read_text().splitlines()) == 32, "only new points are played"
