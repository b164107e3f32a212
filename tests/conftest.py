"""What all tests share: the arm, its skin, and how properties are searched."""

import pytest
from hypothesis import settings

from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing import skin

settings.register_profile("pretouch", deadline=None, derandomize=True, database=None, max_examples=100)
settings.load_profile("pretouch")


@pytest.fixture(scope="session")
def panda_model() -> RobotModel:
    return RobotModel(panda())


@pytest.fixture(scope="session")
def paper_skin(panda_model: RobotModel) -> skin.Skin:
    return skin.paper_skin(panda_model)
