import csv
import json

import pytest
from lab.tests.sweep.made import register, value

from pretouch import cli

X = ("--vary", "scene.x1=-3:3", "--vary", "scene.x2=-3:3")
BASE = ("--vary", "detect.f_base_n=7:20")


@pytest.fixture
def ishigami(monkeypatch):
    register(monkeypatch)


def run(capsys, *args):
    code = cli.main(["sweep", *args])
    return code, capsys.readouterr()


def test_a_sweep_shows_and_writes_what_it_says_and_is_not_played_twice(capsys, tmp_path, ishigami):
    args = ("ishigami", *X, "--samples", "4", "--processes", "1", "--arms", "1", "--out", str(tmp_path))
    code, said = run(capsys, *args)
    assert code == 0
    assert "Sweep: 16 pieces of work" in said.err
    for words in ("scene.x1", "scene.x2", "4 of 4 blocks have it"):
        assert words in said.out
    assert json.loads((tmp_path / "ishigami.json").read_text())["metrics"]["value"]["points"] == 4
    assert (tmp_path / "ishigami.png").stat().st_size > 1000
    header, *rows = csv.reader((tmp_path / "ishigami.csv").read_text().splitlines())
    assert header == ["scene.x1", "scene.x2", "seed", "value"]
    assert len(rows) == 16
    assert all(float(found) == value(float(x1), float(x2), 0.0) for x1, x2, _, found in rows)
    kept = {file: file.stat().st_mtime_ns for file in (tmp_path / "cells").iterdir()}
    code, said = run(capsys, *args)
    assert code == 0
    assert kept == {file: file.stat().st_mtime_ns for file in (tmp_path / "cells").iterdir()}


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("static",), "Nothing is varied: give --vary"),
        (("static", "--vary", "detect.f_base_n"), "has no value: write NAME=LOW:HIGH"),
        (("static", *BASE, *BASE), "names detect.f_base_n twice"),
        (("ishigami", *X), "cannot be swept: choose from static"),
        (("static", *BASE, "--metrics", "force"), "does not measure 'force': choose from peak_estimate_n"),
        (("static", *BASE, "--processes", "-1"), "number of processes is -1"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(capsys, args, words):
    code, said = run(capsys, *args)
    assert code == 2
    assert words in said.err
    assert said.err.count("\n") == 1
