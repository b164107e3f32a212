import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint, EntryPoints

import pytest

from pretouch import cli, extras, plugins
from pretouch.atomic_write import write_json
from pretouch.cli.app import COMMANDS, GROUP, OWN, commands_of, overview
from pretouch.cli.writing import check_writable
from pretouch.profiles import profile


def run(capsys, *args):
    code = cli.main(list(args))
    return code, capsys.readouterr()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_while_words_are_read_end_it_in_order(monkeypatch, number):
    before = signal.getsignal(number)
    monkeypatch.setattr(cli.tyro, "cli", lambda *_args, **_options: signal.raise_signal(number))
    assert cli.main(["warm-up"]) == 128 + number
    assert signal.getsignal(number) is before


def test_a_pipe_is_written_to_and_not_replaced(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    check_writable("file", pipe)
    write_json([1, 2], pipe)
    assert pipe.is_fifo()
    assert json.loads(os.read(reader, 100)) == [1, 2]
    os.close(reader)
    assert list(tmp_path.iterdir()) == [pipe]


@pytest.fixture
def installed(monkeypatch):
    """Install distributions: entry points with name and what they name."""

    def install(*points):
        found = EntryPoints(EntryPoint(*point, GROUP) for point in points)
        monkeypatch.setattr(plugins, "_points", lambda _group: found)

    return install


@pytest.mark.parametrize(
    ("name", "owner"), [(name, owner) for owner in (extras.LAB, extras.FCI) for name in commands_of(owner)]
)
def test_a_command_of_another_distribution_that_is_not_there_is_said_with_what_installs_it(
    installed, capsys, name, owner
):
    installed()
    code, said = run(capsys, name, "--seed", "3")
    assert code == 2
    assert said.err == (
        f"`pretouch {name}` is a command of {owner}, which is not installed: run {extras.install_command(owner)}\n"
    )


@dataclass(frozen=True)
class Added:
    """Add a number."""

    number: int = 3

    def run(self) -> int:
        return self.number


def test_a_command_can_be_added(installed, capsys):
    installed(("added", f"{__name__}:Added"))
    assert run(capsys, "added", "--number", "4")[0] == 4
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    assert "Add a number." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("nowhere.at_all:Command", "cannot be loaded from nowhere.at_all:Command (ModuleNotFoundError: No module"),
        ("pretouch.cli:Nothing", "cannot be loaded from pretouch.cli:Nothing (AttributeError: "),
        ("pretouch.cli:main", "is not a class with run()"),
    ],
)
def test_a_broken_entry_point_is_a_sentence_and_leaves_the_others(installed, capsys, value, said):
    installed(("broken", value))
    code, told = run(capsys, "broken")
    assert code == 2
    assert said in told.err
    assert told.err.count("\n") == 1
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    told = capsys.readouterr()
    assert said in told.err
    assert "warm-up" in told.out


def test_a_command_of_two_distributions_is_refused(installed, capsys):
    installed(("twice", "a:A"), ("twice", "b:B"))
    code, said = run(capsys, "twice")
    assert code == 2
    assert "uninstall one of them" in said.err


# what the command line says of itself, and of words that it does not take


def test_the_overview_fits_a_screen_and_has_each_command_once():
    names = [name for group in COMMANDS.values() for name in group]
    lines = overview(names, {"mine": "Do a thing of my own. " * 5}).splitlines()
    assert len(overview(names, {}).splitlines()) < 24
    assert max(map(len, lines)) <= 80
    assert "live" in lines[1]
    assert any(line.startswith("Added") and " mine " in line for line in lines)


@pytest.mark.parametrize(("words", "name"), [("skin keys", "numba"), ("report", "numba"), ("detect", "scipy.ndimage")])
def test_a_help_loads_no_library_that_the_command_alone_needs(words, name):
    command = [sys.executable, "-X", "importtime", "-m", "pretouch.cli", *words.split(), "--help"]
    assert f" {name}\n" not in subprocess.run(command, capture_output=True, text=True, check=True).stderr


def test_the_overview_leaves_out_what_is_not_installed():
    said = overview(OWN, {})
    assert " demo " not in said
    assert "Experiments" not in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("live --seed many", "--seed: invalid literal"),
        ("run --radius wide", "parsing --radius"),
        ("live --prot 8080", "--port"),
        ("robot import a.urdf --qd-max fast", "--qd-max: 'fast': give numbers, separated by commas"),
        ("skin simulate --keys keys.toml --loss 1.5", "ChannelParams.loss is 1.5: it must be at most 1."),
        ("run --path square", "'circle', 'line', 'hold'"),
        ("replay", "Recording; that of a killed process works too."),
        ("bench dance", "detection, avoidance"),
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
        (
            "skin dance",
            "skin dance is no command of pretouch: choose from "
            + ", ".join(n for n in OWN if n.startswith("skin "))
            + ".",
        ),
    ],
)
def test_words_that_are_no_command_are_one_sentence(capsys, words, said):
    assert cli.main(words.split()) == 2
    assert capsys.readouterr().err == f"{said}\n"


def test_the_name_of_the_table_is_a_profile():
    assert profile("paper-off") == replace(profile("paper:approach=none"), name="paper-off")


@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_reader_that_has_seen_enough_is_no_error(unbuffered):
    command = [sys.executable, "-m", "pretouch.cli", "run", "--help"]
    env = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    with subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as done:
        assert done.stdout is not None
        assert done.stderr is not None
        done.stdout.close()
        assert (done.stderr.read(), done.wait()) == (b"", 141)
