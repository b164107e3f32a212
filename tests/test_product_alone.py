"""The product goes its ways without our other distributions, and without what only figures and sweeps need."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.importing.made import six_axis, written

pytestmark = pytest.mark.slow

HIDDEN = (
    "pretouch_fci", "pretouch_lab", "matplotlib", "mpl_toolkits", "SALib", "pyarrow", "distributed", "viser",
)  # fmt: skip
_ALONE = f"""
import sys
sys.modules.update(dict.fromkeys({HIDDEN}))  # to import one of them is an ImportError
from pretouch.cli import main
if sys.argv[1:2] == ["run"]:  # pushes and checks take seconds
    from pretouch.cli.run import command
    command.GuidedPush.confirm = lambda *_: None
    from pretouch.session import may_move
    may_move.WATCH_S = 1.0
sys.exit(main(sys.argv[1:]))
"""


def alone(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a folder, in a process that finds none of the hidden modules."""
    return subprocess.run([sys.executable, "-c", _ALONE, *words], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("name", ["live", "skin keys", "run", "replay", "detect", "robot import"])
def test_help(tmp_path: Path, name: str):
    done = alone(tmp_path, *name.split(), "--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert f"usage: pretouch {name} " in done.stdout


def test_a_rehearsed_run_is_recorded_and_recomputed(tmp_path: Path):
    words = ("--no-skin", "--profile", "blind", "--path", "hold", "--seconds", "0.1", "--yes", "--no-learnt")
    done = alone(tmp_path, "run", *words, "--record", "a.mcap")
    assert done.returncode == 0, done.stderr
    done = alone(tmp_path, "replay", "a.mcap", "--verify")
    assert done.returncode == 0, done.stderr


def test_contacts_of_a_table_are_found(tmp_path: Path):
    rows = (f"{0.01 * i},0,0,{25 if 300 < i < 320 else 0.1 * (i % 2)}" for i in range(400))
    (tmp_path / "force.csv").write_text("\n".join(["time_s,force_x_N,force_y_N,force_z_N", *rows]))
    done = alone(tmp_path, "detect", "force.csv", "--json", "found.json")
    assert done.returncode == 0, done.stderr
    (profile,) = json.loads((tmp_path / "found.json").read_text())["profiles"]
    assert len(profile["contacts"]) == 1


def test_an_arm_is_imported(tmp_path: Path):
    done = alone(tmp_path, "robot", "import", str(written(tmp_path, six_axis())), "--capsules", "1", "--out", "arm")
    assert done.returncode == 0, done.stderr
    assert alone(tmp_path, "robot", "check", "arm").returncode == 0
