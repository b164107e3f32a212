"""The live page's room for arms that do not come with the package."""

import numpy as np
import pytest
from tests.importing.made import equipped, six_axis, written
from tests.other_arm import copied_panda

from pretouch.control.path import Circle
from pretouch.importing.robot_import import ImportOptions, import_robot, write_folder
from pretouch.page.mouse import Mouse
from pretouch.page.room import LiveSettings, live_path, settings_for
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import profile
from pretouch.robot.description import fr3, robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import LIVE_SKIN, load_skin, skin_for
from pretouch.sim.plant_params import plant_params_of
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import Mode


def test_a_panda_and_an_fr3_have_the_room_as_it_is(panda_model):
    assert settings_for(panda_model, LiveSettings()) == LiveSettings()
    assert settings_for(RobotModel(fr3()), LiveSettings()) == LiveSettings()


def test_the_fr3_has_the_live_skin_of_the_panda(panda_model):
    theirs, model = load_skin(LIVE_SKIN, panda_model), RobotModel(fr3())
    skin = load_skin(LIVE_SKIN.with_name("fr3_live.toml"), model)
    assert skin.ids == theirs.ids
    np.testing.assert_array_equal(skin.T_link_sensor, theirs.T_link_sensor)
    assert [model.links[i].removeprefix("fr3") for i in skin.link] == [
        panda_model.links[i].removeprefix("panda") for i in theirs.link
    ]


def test_an_unknown_arm_of_a_pandas_size_gets_a_pandas_circle(tmp_path):
    model = RobotModel(robot_named(str(copied_panda(tmp_path))))
    settings = settings_for(model, LiveSettings())
    circle = live_path(settings)
    assert isinstance(circle, Circle)
    assert circle.radius == pytest.approx(0.25, rel=0.02)
    assert settings.plant == plant_params_of(model.description)


def test_round_a_larger_arm_the_hand_has_more_space():
    scene, hand = SceneSpec(floor_height=-0.5), HandSpec()
    usual, larger, smaller = (Mouse(np.zeros(3), scene, hand, size) for size in (1.0, 1.5, 0.5))
    np.testing.assert_allclose(usual.highest, [1.4, 1.2, 1.4])
    np.testing.assert_allclose(larger.highest, [2.1, 1.8, 2.1])
    np.testing.assert_allclose(larger.lowest, [-1.5, -1.8, -0.45])
    np.testing.assert_allclose(smaller.highest, usual.highest)


@pytest.mark.slow
def test_an_imported_arm_follows_its_path_and_answers_the_hand(tmp_path):
    found = import_robot(written(tmp_path, six_axis()), ImportOptions(capsules=1))
    write_folder(found, tmp_path / "six")
    model = RobotModel(robot_named(str(equipped(tmp_path / "six"))))
    settings = settings_for(model, LiveSettings(profile=profile("pretouch")))
    simulation = LiveSimulation(settings, model, skin_for(model))
    begin = simulation.frame.step.path_position
    simulation.play_opening()
    steps = simulation.advance(14.0)
    modes = [step.mode for step in steps]
    assert Mode.REACT in modes
    assert modes[-1] is Mode.TRACK
    on_path = [np.linalg.norm(s.ee_position - s.path_position) for s in steps[: modes.index(Mode.REACT)]]
    assert max(on_path) < 0.01
    assert max(np.linalg.norm(s.path_position - begin) for s in steps) > 0.3
