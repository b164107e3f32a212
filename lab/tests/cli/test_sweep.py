import json

import pytest
from lab.tests.sweep.made import register

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
    docs, out = tmp_path / "docs", tmp_path / "out"
    (docs / "results").mkdir(parents=True)
    document = docs / "results" / "sensitivity.md"
    document.write_text("By hand.\n<!-- tried: generated, begin -->\n<!-- tried: generated, end -->\n")
    args = (
        "ishigami", *X, "--samples", "4", "--name", "tried", "--processes", "1", "--out", str(out), "--docs", str(docs),
    )  # fmt: skip
    code, said = run(capsys, *args)
    assert code == 0
    assert "24 cells to play" in said.err or "20 cells to play" in said.err
    assert "scene.x1" in said.out
    text = document.read_text()
    assert text.startswith("By hand.")
    assert "![tried: first-order and total indices](../images/sweep-tried.png)" in text
    assert (docs / "images" / "sweep-tried.png").stat().st_size > 1000
    assert (out / "tried" / "results.parquet").exists()
    assert json.loads((out / "tried" / "indices.json").read_text())["failed"] == 0
    code, said = run(capsys, *args)
    assert code == 0
    assert "0 cells to play" in said.err


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("static",), "Nothing is varied: give --vary"),
        (("static", "--vary", "detect.f_base_n"), "has no value: write NAME=LOW:HIGH"),
        (("static", *BASE, *BASE), "names detect.f_base_n twice"),
        (("sensitivity", "--vary", "scene.x1=0:1"), "--vary goes with an experiment, not with sensitivity"),
        (("ishigami", *X), "contacts. It only tested the sweep"),
        (("missing.toml",), "missing.toml is neither an experiment nor a file"),
        (("static", *BASE, "--processes", "-1"), "number of processes is -1"),
        (("static", *BASE, "--docs", "nowhere"), "nowhere/results/sensitivity.md cannot be read"),
    ],
)
def test_what_cannot_be_done_is_said_in_a_sentence(capsys, args, words):
    code, said = run(capsys, *args)
    assert code == 2
    assert words in said.err
    assert "Traceback" not in said.err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("sweep = 3", "has no [[sweep]]: give at least one"),
        ("[[sweep]\n", "is not valid TOML"),
        ('[[sweep]]\nexperiment = "ishigami"\nranges = 3\n', "has the unknown key ranges"),
        ('[[sweep]]\nexperiment = "ishigami"\nsamples = "8"\n', "samples = '8': give a whole number"),
        ('[[sweep]]\nexperiment = "ishigami"\n[sweep.vary]\n"scene.x1" = 3\n', "scene.x1 = 3: give text"),
        ('[[sweep]]\nexperiment = "ishigami"\n[sweep.vary]\n"scene.x9" = "1:2"\n', "x3, pause_s. (in sweep 1 of"),
        ('[[sweep]]\nexperiment = "ishigami"\n[sweep.vary]\n"scene.x1" = "1:2"\n' * 2, "have the same name"),
    ],
)
def test_a_sweep_file_that_is_wrong_is_said(capsys, tmp_path, text, words, ishigami):
    path = tmp_path / "s.toml"
    path.write_text(text)
    code, said = run(capsys, str(path), "--out", str(tmp_path))
    assert code == 2
    assert words in said.err
