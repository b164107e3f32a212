import pytest

from pretouch.extras import FRANKA
from pretouch.robot.description import fr3
from pretouch.robot.model import RobotModel
from tests.needs import modules_with

pytest_pycollect_makemodule = modules_with(FRANKA)


@pytest.fixture(scope="session")
def fr3_model() -> RobotModel:
    return RobotModel(fr3())
