"""What the command line says of itself, and of words that it does not take."""

import os
import subprocess
import sys
from dataclasses import replace

import pytest

from pretouch import cli
from pretouch.cli.overview import GROUPS, SHELLS, overview
from pretouch.cli.registry import FCI, LAB, OWN
from pretouch.profiles import profile


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


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("live --seed many", "--seed: invalid literal"),
        ("run --radius wide", "parsing --radius"),
        ("live --prot 8080", "--port"),
        ("run --path square", "'circle', 'line', 'hold'"),
        ("replay", "Recording; that of a killed process works too."),
        ("skin dance", "monitor, calibrate, coverage, simulate, provision, keys"),
    ],
)
def test_wrong_words_are_answered_with_what_is_right(capsys, monkeypatch, words, said):
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit) as stop:
        cli.main(words.split())
    assert stop.value.code == 2
    assert said in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("repaly", "repaly is no command of pretouch: perhaps replay."),
        ("xyz", "xyz is no command of pretouch: pretouch --help lists them."),
        ("completion fish", f"pretouch completion is for one shell: choose from {', '.join(SHELLS)}."),
    ],
)
def test_words_that_are_no_command_are_one_sentence(capsys, words, said):
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
