import json

import pytest

from pretouch.cli import main
from tests.importing.made import six_axis, written


def test_an_arm_is_imported_checked_and_reported(tmp_path, capsys):
    file = written(tmp_path, six_axis())
    out, numbers = tmp_path / "mine", tmp_path / "fit.json"
    ready = "0,0.3,1.2,0,1.6,0"
    told = ["robot", "import", str(file), "--out", str(out), "--ready", ready, "--json", str(numbers)]
    assert main(told) == 0
    printed = capsys.readouterr().out
    for part in ("sixer: 6 joints, end-effector tool0", "whole arm", "sticks out", "manipulability", "Written: "):
        assert part in printed
    assert json.loads(numbers.read_text())["whole_arm"]["points"] > 500
    assert main(["robot", "check", str(out)]) == 0
    assert "In order" in capsys.readouterr().out
    assert main(told) == 2
    assert "is there: give another --out, or --force" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--ee", "hand"], "The link 'hand' is unknown: choose from base"),
        (["--qd-max", "fast"], "--qd-max is 'fast': give numbers"),
        (["--capsules", "0"], "--capsules is 0: give 1 to 10"),
        (["--package-path", "/nowhere"], "The package path /nowhere is no folder"),
    ],
)
def test_misuse_is_one_sentence(tmp_path, capsys, more, sentence):
    assert main(["robot", "import", str(written(tmp_path, six_axis())), "--out", str(tmp_path / "o"), *more]) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert len(error.strip().splitlines()) == 1


def test_a_folder_that_is_no_arm_is_said(tmp_path, capsys):
    assert main(["robot", "check", str(tmp_path)]) == 2
    assert "robot.toml cannot be read" in capsys.readouterr().err
    assert main(["reproduce", "static", "--arm", str(tmp_path), "--out", str(tmp_path / "out")]) == 2
    assert "robot.toml cannot be read" in capsys.readouterr().err
