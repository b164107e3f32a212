from dataclasses import replace

import pytest
from tests.other_arm import copied_panda
from tests.recording.runs import custom_arm

from pretouch.control.path import Circle
from pretouch.errors import ExperimentError
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.sim.paper_scenes import (
    PANDA_SIDE,
    HandSide,
    Placement,
    assumptions,
    hand_side,
    placement_for,
    static_path,
    static_scene,
)
from pretouch.sim.plant_params import assumed_plant
from pretouch_lab.placement import UNMOVED, PeoplePlacement, people_placement


def test_the_panda_has_the_papers_paths_and_the_side_of_its_hand_is_about_what_the_board_takes_it_for(panda_model):
    placement = placement_for(panda_model)
    assert placement == Placement()
    assert people_placement(panda_model) == UNMOVED
    assert static_path("circle", "-y", placement) == Circle()
    assert placement.face(0.2371, "+y") == 0.2371
    for side in ("+y", "-y"):
        own = hand_side(panda_model, side)
        assert own.aside == pytest.approx(PANDA_SIDE.aside, abs=0.03)
        assert own.above == pytest.approx(PANDA_SIDE.above, abs=0.03)


def test_an_arm_of_too_few_joints_is_refused_with_its_joints(tmp_path):
    with pytest.raises(ExperimentError, match=r"two has 2 joints \(j1, j2\): .* needs 6. .*another --ee"):
        placement_for(RobotModel(custom_arm(tmp_path)))


def test_of_a_simulated_arm_it_is_said_what_is_assumed(panda_model, tmp_path):
    assert assumptions(panda_model, Placement()) == ()
    other = RobotModel(robot_named(str(copied_panda(tmp_path))))
    paths, plant = assumptions(other, Placement(0.8))
    assert paths.startswith("The paper's paths for panda: 0.8 times as large and as far from the base")
    assert "hand" not in paths
    assert assumptions(other, Placement()) == (plant,) == (assumed_plant(other.description),)
    assert "those of a Panda" in plant
    weaker = replace(other.description, tau_max=other.description.tau_max / 2)
    assert "scaled by torque limits" in assumed_plant(weaker)


def test_another_arm_has_them_scaled_and_the_board_stands_where_its_hand_meets_it():
    placement = Placement(0.8, left=HandSide(0.05, 0.01))
    circle = static_path("circle", "+y", placement)
    assert circle.center == pytest.approx((0.4, 0.0, 0.2))
    assert circle.radius == pytest.approx(0.2)
    # the hand is as far out when it meets the board's face, in terms of the circle, as the Panda's
    meets = placement.face(0.25, "+y") - 0.05
    assert meets / 0.2 == pytest.approx((0.25 - PANDA_SIDE.aside) / 0.25)
    assert "0.8 times as large" in placement.paths_sentence("mine")
    board = static_scene("line", "+y", 25e3, 0, placement).boxes[0]
    face = board.center[1] - board.half_size[1]
    assert 0.8 * (0.25 - 0.05 - PANDA_SIDE.aside) + 0.05 <= face <= 0.8 * (0.3 - PANDA_SIDE.aside) + 0.05


def test_what_stands_beside_the_circle_keeps_its_distance_and_a_persons_hand_is_as_high_as_the_robots_side():
    assert UNMOVED.moved(0.5, -0.8, 0.3) == (0.5, -0.8, 0.3)
    placement = PeoplePlacement(0.8)
    assert "0.8 times as large" in placement.sentence("mine")
    assert placement.moved(0.5, -0.8, 0.3) == pytest.approx((0.4, -0.75, 0.24))
    assert placement.moved(0.5, 0.1, 0.3) == pytest.approx((0.4, 0.08, 0.24))
    placement = PeoplePlacement(0.8, HandSide(0.05, 0.01), HandSide(0.05, -0.08), (0.37, 0.36), (0.29, 0.28))
    assert placement.visited("beside", -1.0) == pytest.approx((0.4, -0.37, 0.2 - 0.08 - 0.057 + 0.05))
    assert placement.visited("inside", 1.0) == pytest.approx((0.4, 0.28, 0.2 + 0.01 - 0.057 + 0.05))
