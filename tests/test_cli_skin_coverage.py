"""`pretouch skin coverage`."""

import json

import pytest

from pretouch.cli import main
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import PAPER_SKIN, load_skin, skin_for
from tests.importing.made import six_axis, written


def test_numbers_and_a_skin_with_more_units(tmp_path, capsys, panda_model):
    skin, numbers = tmp_path / "more.toml", tmp_path / "coverage.json"
    told = ["skin", "coverage", str(PAPER_SKIN), "--workspace", "circle", "--postures", "4", "--seed", "1000"]
    told += ["--suggest", "2", "--sensor", "vl53l5cx", "--out", str(skin), "--json", str(numbers)]
    assert main(told) == 0
    printed = " ".join(capsys.readouterr().out.split())
    for part in ("Seen in time: panda, 4 postures of circle", "whole arm", "be seen 0.37 m", "forearm_left",
                 "Blind spots, with less than 10 % of the paths seen:", "panda_link2, its back, ", " cm^2",
                 "2 more units:",
                 "suggested_2", f"Skin: {skin}"):  # fmt: skip
        assert part in printed
    assert "suggested_1/" not in printed, "a unit with zones is shown whole"
    assert [unit.id for unit in load_skin(skin, panda_model).mounted[-2:]] == ["suggested_1", "suggested_2"]
    found = json.loads(numbers.read_text())
    assert found["asked"]["approach"]["warning_m"] == pytest.approx(0.373)
    assert found["links"][-1]["name"] == "whole arm"
    for what in ("links", "met", "hand"):
        assert found["after"][what][-1]["ways"] > found["before"][what][-1]["ways"] > 0
    areas = [spot["area_m2"] for spot in found["blind_spots"]]
    assert areas == sorted(areas, reverse=True)
    assert main(told) == 2
    assert "exists already: give another name, or --replace" in capsys.readouterr().err


def test_an_imported_arm_gets_its_first_units(tmp_path, capsys):
    arm = tmp_path / "mine"
    told = ["robot", "import", str(written(tmp_path, six_axis())), "--capsules", "1", "--ready", "0,0.3,1.2,0,1.6,0"]
    assert main([*told, "--out", str(arm)]) == 0
    skin = f"--suggest 8 --out {arm / 'skin.toml'}"
    assert f"pretouch skin coverage --arm {arm} --workspace joints {skin}" in capsys.readouterr().out
    told = ["skin", "coverage", "--arm", str(arm), "--workspace", "joints", "--postures", "3"]
    assert main(told) == 2
    assert skin in capsys.readouterr().err
    assert main([*told, *skin.split()]) == 0
    assert "8 more units:" in capsys.readouterr().out
    own = skin_for(RobotModel(robot_named(arm)))
    assert list(own.ids) == [f"suggested_{i}" for i in range(1, 9)]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--out", "x.toml"], "give their number with --suggest"),
        (["--suggest", "-1"], "--suggest is -1: give 1 or more"),
        (["--seed", "-1"], "The seed is -1: give 0 or more"),
        (["--workspace", "moon"], "The workspace is 'moon': give circle"),
        (["--suggest", "400", "--postures", "2"], "400 more units were requested, but"),
        (["--suggest", "1", "--sensor", "sonar"], "--sensor has the sensor 'sonar': choose from"),
        (["--arm", "no-such-arm"], "no-such-arm"),
        (["--json", "a.json", "--suggest", "1", "--out", "a.json/b.toml"], "is also another input or output file"),
    ],
)
def test_what_cannot_be_done_is_said(more, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["skin", "coverage", *more]) == 2
    assert said in " ".join(capsys.readouterr().err.split())


def test_parameters_that_leave_no_time_are_said(capsys):
    with pytest.raises(SystemExit):
        main(["skin", "coverage", "--object-speed-m-s", "3"])
    words = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "before contact, but the paths are only 0.8 m long: give lower speeds" in words


def test_the_skin_file_that_is_read_is_never_written(tmp_path, capsys):
    mine = tmp_path / "mine.toml"
    mine.write_text(PAPER_SKIN.read_text())
    assert main(["skin", "coverage", str(mine), "--suggest", "1", "--out", str(mine), "--replace"]) == 2
    assert "is also another input or output file" in capsys.readouterr().err
    assert mine.read_text() == PAPER_SKIN.read_text()
