"""What a simulation assumes of an arm that does not come with the package."""

import pytest

from pretouch.coverage.assumed import assumptions, floor_under
from pretouch.robot.model import RobotModel
from pretouch.robot.named import robot_named
from pretouch.sim.paper_scenes import Placement
from tests.other_arm import copied_panda


@pytest.fixture(scope="module")
def other(tmp_path_factory):
    return RobotModel(robot_named(str(copied_panda(tmp_path_factory.mktemp("arm")))))


def test_nothing_is_assumed_of_an_arm_of_the_package(panda_model):
    assert floor_under(panda_model, Placement(shift_z=-0.3)) == -0.2
    assert assumptions(panda_model, Placement(), -0.2) == ()


def test_the_floor_is_as_low_as_the_arm_comes_and_a_tenth_of_a_metre(other):
    # the circle's lowest point is at 0, and the ends of the closed fingers reach 1 cm below the hand's origin
    assert floor_under(other, Placement()) == -0.2
    lower = floor_under(other, Placement(shift_z=-0.15))
    assert lower == pytest.approx(-0.15 - 0.01 - 0.1, abs=0.015)
    assert floor_under(other, Placement(shift_z=-0.2)) == pytest.approx(lower - 0.05, abs=0.011)


def test_what_is_assumed_is_said(other):
    paths, floor, plant = assumptions(other, Placement(0.8, 0.1), -0.3)
    assert paths.startswith("The paper's paths for panda: 0.8 times as large, moved by +0.10 m in x")
    assert floor == "The floor is at -0.30 m, for on its paths the arm reaches lower than a Panda."
    assert "scaled by torque limits: none was measured on this arm" in plant
    assert assumptions(other, Placement(), -0.2) == (plant,)
