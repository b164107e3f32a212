import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from importlib.metadata import EntryPoint, EntryPoints

import pytest

from pretouch import cli, extras, plugins
from pretouch.atomic_write import write_json
from pretouch.cli.registry import FCI, GROUP, LAB
from pretouch.cli.writing import check_writable


def run(capsys, *args):
    code = cli.main(list(args))
    return code, capsys.readouterr()


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("live", "--port", "0"), "The port is 0: give one from 1 to 65535"),
        (("live", "--path", "square"), "The path is 'square': choose circle or line"),
        (("replay", "/dev/null", "--no-page"), "/dev/null is no file"),
        (("report", "/nowhere.mcap"), "/nowhere.mcap cannot be read: it does not exist"),
    ],
)
def test_bad_input_ends_with_one_sentence_and_code_2(capsys, args, words):
    code, said = run(capsys, *args)
    assert code == 2
    assert words in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


def test_help_needs_none_of_the_heavy_packages():
    heavy = ("numpy", "scipy", "numba", "mujoco", "matplotlib")
    code = f"""
import sys, pretouch.cli
try:
    pretouch.cli.main(["--help"])
except SystemExit:
    sys.exit(', '.join(m for m in {heavy} if m in sys.modules) or 0)
"""
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)


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
    ("name", "owner"), [*((name, extras.LAB) for name in LAB), *((name, extras.FCI) for name in FCI)]
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
