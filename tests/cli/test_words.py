"""What the command line says of itself, and of words that it does not take."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import pytest

from pretouch import cli
from pretouch.cli.overview import GROUPS, SHELLS, overview
from pretouch.cli.registry import FCI, LAB, OWN
from pretouch.profiles import profile
from tests.cli.commands import COMMANDS


def test_the_overview_fits_a_screen_and_has_each_command_once():
    names = [name for group in GROUPS.values() for name in group]
    assert sorted(names) == sorted((*OWN, *FCI, *LAB))
    lines = overview(dict.fromkeys((*OWN, *FCI, *LAB, "mine"), "Do a thing of my own. " * 5)).splitlines()
    assert len(lines) < 24
    assert max(map(len, lines)) <= 80
    assert "live" in lines[1]
    assert any(line.startswith("Added") and " mine " in line for line in lines)


def test_the_overview_leaves_out_what_is_not_installed():
    said = overview(dict.fromkeys(OWN, ""))
    assert " demo " not in said
    assert "Experiments" not in said


@pytest.mark.parametrize("width", ["40", "80", "200"])
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("live --seed many", "--seed is 'many': give a whole number. See pretouch live --help."),
        ("live --seed=many", "--seed is 'many': give a whole number. See pretouch live --help."),
        ("run --radius wide", "--radius is 'wide': give a number. See pretouch run --help."),
        ("run --cpu x", "--cpu is 'x': give a whole number. See pretouch run --help."),
        ("live --prot 8080", "--prot is unknown: perhaps --port. See pretouch live --help."),
        ("run --path square", "--path is 'square': choose from circle, line, hold. See pretouch run --help."),
        ("live --seed", "--seed lacks a value: give 1. See pretouch live --help."),
        ("live here", "here is unknown. See pretouch live --help."),
        (
            "skin keys",
            "pretouch skin keys lacks --keys: File of the units' keys; created if it is missing, readable only by you."
            " See pretouch skin keys --help.",
        ),
        (
            "replay",
            "pretouch replay lacks an argument: Recording; that of a killed process works too."
            " See pretouch replay --help.",
        ),
        (
            "skin dance",
            "dance is unknown: choose from monitor, calibrate, coverage, simulate, provision, keys."
            " See pretouch skin --help.",
        ),
        ("repaly", "repaly is no command of pretouch: perhaps replay."),
        ("xyz", "xyz is no command of pretouch: pretouch --help lists them."),
        ("completion fish", f"pretouch completion is for one shell: choose from {', '.join(SHELLS)}."),
    ],
)
def test_wrong_words_are_one_sentence(capsys, monkeypatch, words, said, width):
    monkeypatch.setenv("COLUMNS", width)
    assert cli.main(words.split()) == 2
    assert capsys.readouterr().err == f"{said}\n"


def test_bash_takes_the_completion(capsys):
    with pytest.raises(SystemExit) as stop:
        cli.main(["completion", "bash"])
    assert not stop.value.code
    script = capsys.readouterr().out
    assert "--profile" in script
    subprocess.run(["bash", "-n"], input=script, text=True, check=True)  # noqa: S607


def test_the_name_of_the_table_is_a_profile():
    assert profile("paper-off") == replace(profile("paper:approach=none"), name="paper-off")
    assert profile("pretouch-zones:slow=on").perception.out_of_view_s == 5


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_seen_enough_is_no_error(unbuffered):
    command = [sys.executable, "-m", "pretouch.cli", "run", "--help"]
    env = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as done:
        assert done.stdout is not None
        assert done.stderr is not None
        done.stdout.close()
        assert (done.stderr.read(), done.wait()) == (b"", 141)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits_a_terminal_of_80_columns_and_shows_no_empty_default(capsys, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as stop:
        cli.main([*name.split(), "--help"])
    assert stop.value.code == 0
    said = capsys.readouterr().out
    assert max(map(len, said.splitlines())) <= 80
    for nothing in ("(default: '')", "(default: )", "(default: None)"):
        assert nothing not in " ".join(said.split())


REQUIRED = {
    "skin monitor": ("--keys", "k"), "skin simulate": ("--keys", "k"), "robot import": ("a",), "replay": ("a",),
    "skin provision": ("--id", "a", "--keys", "k", "--ssid", "s", "--host", "h"), "detect": ("a",), "figure": ("a",),
    "sweep": ("a",), "policy": ("a",),
}  # fmt: skip
"""Words that a command needs."""


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_no_number_is_one_sentence(capsys, monkeypatch, name):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        cli.main([*name.split(), "--help"])
    for option in re.findall(
        r"^  (--[\w-]+) (?:\{None\}\|)?(?:INT|FLOAT)(?:  |$)", capsys.readouterr().out, re.MULTILINE
    ):
        assert cli.main([*name.split(), *REQUIRED.get(name, ()), option, "many"]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.count("\n") == 1
        assert f"{option} is 'many': give a" in said.err
