"""An arm that moves, and what two units on it measure."""

import pytest

from pretouch.calibration.values import CalibrationData
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.random_skin import random_skin
from tests.calibration.made import MovingArm


@pytest.fixture(scope="session")
def moving_arm(panda_model: RobotModel) -> MovingArm:
    return MovingArm(panda_model)


@pytest.fixture(scope="session")
def whole_skin(panda_model: RobotModel) -> Skin:
    """One unit on each link from the second on, by the name on_<link>."""
    return random_skin(panda_model, 0)


@pytest.fixture(scope="session")
def pair(panda_model: RobotModel, whole_skin: Skin) -> Skin:
    """A unit on the fourth link, and one on the hand."""
    return Skin([unit for unit in whole_skin.units if unit.link in ("panda_link4", "panda_hand")], panda_model)


@pytest.fixture(scope="session")
def good(moving_arm: MovingArm, pair: Skin) -> CalibrationData:
    """What is measured with `pair`."""
    return moving_arm.data(pair)
