"""The arm of docs/how-to/your-own-arm.md, as another distribution adds it, and `pretouch run` with it."""

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pretouch import cli, plugins
from pretouch.arms import OpenedArm, arm_class, arm_names
from pretouch.errors import PluginError
from pretouch.recording.reader import open_recording
from pretouch.session.memory import ConfirmedRobots
from pretouch.session.push import GuidedPush

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "your-own-arm.md"
POINTS = "[pretouch.arms]\nmine = my_package:Mine\nodd = my_package:Driver\n"


@pytest.fixture(autouse=True)
def _installed(tmp_path, monkeypatch):
    (block,) = re.findall(r"^```python\n(.*?class Mine.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "my_package.py").write_text(block)
    about = tmp_path / "my_package-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1\n")
    (about / "entry_points.txt").write_text(POINTS)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    plugins._points.cache_clear()
    yield
    plugins._points.cache_clear()
    sys.modules.pop("my_package", None)


def test_it_is_run_with_options_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("pretouch.session.may_move.WATCH_S", 0.5)
    monkeypatch.setattr(GuidedPush, "confirm", lambda *_: None)
    words = "--device", "/dev/ttyS7", "--no-skin", "--profile", "blind", "--path", "hold", "--yes"
    assert cli.main(["run", "mine", *words, "--seconds", "0.2", "--record", "a.mcap"]) == 0
    said = capsys.readouterr().out
    for part in ("arm at /dev/ttyS7: checking it", "The arm is at rest.", "The line to the driver was never late."):
        assert part in said
    assert len(open_recording(tmp_path / "a.mcap")) > 0
    assert "mine at /dev/ttyS7" in ConfirmedRobots(tmp_path / "state" / "pretouch").path.read_text()


def test_its_options_are_in_its_help_alone(capsys):
    for words in (["run", "mine", "--help"], ["run", "--help"]):
        with pytest.raises(SystemExit):
            cli.main(words)
        said = capsys.readouterr().out
        assert ("Serial device of its driver." in said, "--priority" in said) == ("mine" in words, False)


def test_a_commander_of_whom_nothing_is_said_before_the_arm_moves_is_refused():
    with pytest.raises(PluginError, match=r"^a has a commander: say in OpenedArm\.announced what that lets"):
        OpenedArm(SimpleNamespace(name="a"), commander=lambda: None)


def test_an_entry_point_that_is_no_arm_is_refused_by_name():
    assert {"simulated", "franka", "mine", "odd"} <= set(arm_names())
    with pytest.raises(PluginError, match=r"of the arm 'odd' is not a subclass of pretouch\.arms\.ArmOptions"):
        arm_class("odd")
