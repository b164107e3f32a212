import json

import pytest

from pretouch.cli import main
from tests.importing.made import six_axis, written

READY = "0,0.3,1.2,0,1.6,0"


def imported(folder, *more):
    """Import an arm of six axes to a folder's `out`, by the options of somebody in a hurry and more."""
    told = ["robot", "import", str(written(folder, six_axis())), "--out", str(folder / "out"), "--capsules", "1"]
    return main([*told, *more])


def test_an_arm_is_imported_and_reported(tmp_path, capsys):
    numbers = tmp_path / "fit.json"
    told = tmp_path, "--ready", READY, "--json", str(numbers)
    assert imported(*told) == 0
    printed = capsys.readouterr().out
    for part in ("sixer: 6 joints, end-effector tool0", "stand over", "sticks out", "singular value", "Written: "):
        assert part in printed
    assert "of its capsules most, by" in printed
    assert "raise approach.d_repulse_m by as much, or import with --cover" in printed
    assert json.loads(numbers.read_text())["links"][1]["sticks_out"] > 1e-3
    assert imported(*told) == 2
    assert "exists already: give another --out, or remove it" in capsys.readouterr().err


def test_a_folder_of_the_arms_own_name_is_refused_before_anything_is_fitted(tmp_path, capsys, monkeypatch):
    file = written(tmp_path, six_axis())
    (tmp_path / "sixer").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pretouch.cli.robot.import_robot", lambda *_: pytest.fail("imported"))
    assert main(["robot", "import", str(file)]) == 2
    assert "The folder sixer exists already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        (["--ee", "hand"], "The link 'hand' is unknown: choose from base"),
        (["--capsules", "0"], "--capsules is 0: give 1 to 10"),
        (["--package-path", "/nowhere"], "The package path /nowhere is not a folder"),
    ],
)
def test_misuse_is_one_sentence(tmp_path, capsys, more, sentence):
    assert imported(tmp_path, *more) == 2
    error = capsys.readouterr().err
    assert sentence in error
    assert len(error.strip().splitlines()) == 1


def test_a_ready_posture_that_is_not_clear_is_said_and_the_import_is_kept(tmp_path, capsys):
    assert imported(tmp_path, "--ready", "0,0,2.7,0,2.7,0") == 0
    assert "mm: choose another posture" in capsys.readouterr().out
