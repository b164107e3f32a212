"""Arms by their names: of the package, and of folders."""

from pathlib import Path

import pytest
from tests.other_arm import copied_panda

from pretouch.errors import RobotModelError, SkinError
from pretouch.robot.description import fr3, is_shipped, panda, robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import OWN_SKIN, PAPER_SKIN, skin_for


def test_the_packages_arms_have_names():
    assert robot_named("panda").mjcf == panda().mjcf
    assert robot_named("fr3").ee_body == "fr3_hand_tcp"


def test_an_unknown_name_is_refused_with_those_there_are():
    with pytest.raises(RobotModelError, match=r"no arm 'pandora': take one of panda, fr3, or a folder"):
        robot_named("pandora")


def test_only_the_packages_arms_are_shipped(tmp_path: Path):
    assert is_shipped(panda())
    assert is_shipped(fr3())
    assert not is_shipped(robot_named(str(copied_panda(tmp_path))))


def test_a_folder_is_an_arm_and_the_skin_beside_it_is_its_skin(tmp_path: Path):
    model = RobotModel(robot_named(str(copied_panda(tmp_path))))
    (tmp_path / OWN_SKIN).unlink()
    assert model.description.mjcf.parent == tmp_path
    assert len(skin_for(model)) == 7  # it is called panda
    text = PAPER_SKIN.read_text()
    second = text.index("[[unit]]", text.index("[[unit]]") + 1)
    (tmp_path / OWN_SKIN).write_text(text[:second])
    assert len(skin_for(model)) == 1
    assert len(skin_for(model, PAPER_SKIN)) == 7
    with pytest.raises(SkinError, match=r"/nowhere\.toml cannot be read"):
        skin_for(model, "/nowhere.toml")
