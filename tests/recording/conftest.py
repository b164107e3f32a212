"""A controller of the paper's arm and skin, whose runs are recorded."""

import pytest

from pretouch.controller import Controller
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from tests.following_arm import controller_of


@pytest.fixture(scope="session")
def controller(panda_model: RobotModel, paper_skin: Skin) -> Controller:
    return controller_of(panda_model, paper_skin)
