"""The live page's room: where a pointer may lead the hand, and what it is like for other arms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.importing.made import equipped, six_axis, written
from tests.other_arm import copied_panda

from pretouch.control.path import Circle
from pretouch.errors import ParameterError
from pretouch.importing.robot_import import ImportOptions, import_robot, write_folder
from pretouch.page.room import HAND_FORCE_N, LiveSettings, Mouse, Room, at_depth, live_path, settings_for
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin, skin_for
from pretouch.sensing.unit import TouchPatch
from pretouch.sim.plant_params import plant_params_of
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import Mode

HAND, SCENE = HandSpec(), SceneSpec(hand=HandSpec())
EYE = np.array([1.75, 0.95, 0.85])


def test_a_panda_and_an_fr3_have_the_room_as_it_is(panda_model, fr3_model):
    assert settings_for(panda_model, LiveSettings()) == settings_for(fr3_model, LiveSettings()) == LiveSettings()


def test_an_unknown_arm_of_a_pandas_size_gets_a_pandas_circle(tmp_path):
    model = RobotModel(robot_named(str(copied_panda(tmp_path))))
    settings = settings_for(model, LiveSettings())
    circle = live_path(settings)
    assert isinstance(circle, Circle)
    assert circle.radius == pytest.approx(0.25, rel=0.02)
    assert settings.plant == plant_params_of(model.description)


def test_a_silenced_unit_sends_no_touches_either(panda_model, paper_skin):
    one, *others = (replace(unit, touch=TouchPatch()) for unit in paper_skin.units[:2])
    settings = LiveSettings(silenced=frozenset({one.id}))
    room = Room(settings, live_path(settings), panda_model, Skin([one, *others], panda_model))
    for _ in range(10):
        room.tick()
    assert np.isfinite(room.units.touch().stamp).tolist() == [False, True]


@pytest.mark.slow
def test_an_imported_arm_follows_its_path_and_answers_the_hand(tmp_path):
    imported = import_robot(written(tmp_path, six_axis()), ImportOptions(capsules=1))
    write_folder(imported, tmp_path / "six")
    model = RobotModel(robot_named(str(equipped(tmp_path / "six"))))
    settings = settings_for(model, LiveSettings(profile=profile("pretouch")))
    simulation = LiveSimulation(settings, model, skin_for(model))
    begin = simulation.frame.step.path_position
    simulation.play_opening()
    steps = simulation.advance(14.0)
    modes = [step.mode for step in steps]
    assert Mode.REACT in modes
    assert modes[-1] is Mode.TRACK
    free = [s for s in steps[: modes.index(Mode.REACT)] if not np.any(s.obstacles.body_distance < 0.1)]
    assert max(np.linalg.norm(s.ee_position - s.path_position) for s in free) < 0.01
    assert max(np.linalg.norm(s.path_position - begin) for s in steps) > 0.3


# where a pointer may lead the hand


def test_round_a_larger_arm_the_hand_has_more_space():
    scene, hand = SceneSpec(floor_height=-0.5), HandSpec()
    usual, larger, smaller = (Mouse(np.zeros(3), scene, hand, size) for size in (1.0, 1.5, 0.5))
    np.testing.assert_allclose(usual.highest, [1.4, 1.2, 1.4])
    np.testing.assert_allclose(larger.highest, [2.1, 1.8, 2.1])
    np.testing.assert_allclose(larger.lowest, [-1.5, -1.8, -0.45])
    np.testing.assert_allclose(smaller.highest, usual.highest)


@given(arrays(np.float64, 3, elements=st.floats(-1e6, 1e6)))
def test_a_target_anywhere_is_clipped_to_the_workspace_above_the_floor(target):
    mouse = Mouse(np.zeros(3), SCENE, HAND)
    mouse.move(target)
    low, high = [-1.0, -1.2, -0.2 + HAND.radius], [1.4, 1.2, 1.4]
    np.testing.assert_array_equal(mouse.target, np.clip(target, low, high))
    goal = mouse.goal(0.0, np.zeros(3), None)
    np.testing.assert_array_equal(goal.position, mouse.target)
    assert goal.force_max == HAND_FORCE_N


@pytest.mark.parametrize("target", [[0.5, np.nan, 0.3], [np.inf, 0.0, 0.3], [0.5, 0.3], [[0.5, 0.3, 0.1]]])
def test_what_is_no_place_is_refused_and_the_target_stays(target):
    mouse = Mouse(np.array([0.5, 0.3, 0.2]), SCENE, HAND)
    with pytest.raises(ParameterError, match=r"The hand's target is .*: give x, y and z in metres"):
        mouse.move(np.array(target))
    np.testing.assert_array_equal(mouse.target, [0.5, 0.3, 0.2])


def test_a_place_pointed_to_on_the_arm_is_at_the_arms_depth(panda_model):
    q = panda_model.description.q_ready
    palm = panda_model.kinematics(q).position[panda_model.link_index("panda_hand")]
    before = EYE + 0.8 * (palm - EYE)  # nearer, in the same place of the picture
    place = at_depth(panda_model, q, EYE, before)
    assert np.linalg.norm(before - palm) > 0.3
    assert np.linalg.norm(place - palm) < 0.08
    assert np.linalg.norm(np.cross(place - EYE, palm - EYE)) < 1e-9


def test_a_place_pointed_to_far_from_the_arm_stays_and_in_between_nothing_jumps(panda_model):
    q = panda_model.description.q_ready
    far = np.array([0.6, 1.1, 0.4])
    np.testing.assert_allclose(at_depth(panda_model, q, EYE, far), far, atol=1e-3)
    palm = panda_model.kinematics(q).position[panda_model.link_index("panda_hand")]
    way = [at_depth(panda_model, q, EYE, far + share * (palm - far)) for share in np.linspace(0.0, 1.0, 400)]
    assert np.linalg.norm(np.diff(way, axis=0), axis=1).max() < 0.03


@pytest.mark.parametrize("eye", [(np.nan, 0.0, 0.0), (1.0, 2.0)])
def test_an_eye_that_is_no_place_is_refused(panda_model, eye):
    mouse = Mouse(np.zeros(3), SceneSpec(), HandSpec())
    with pytest.raises(ParameterError, match="The camera's position is"):
        mouse.point(np.array(eye), np.zeros(3), panda_model, panda_model.description.q_ready)
