"""Tests of the product's Franka arm against the served one, through the vendor's libraries."""

import pytest
from fci.tests.driver.served import Served
from tests.needs import modules_with

from pretouch.extras import FRANKA
from pretouch.robot.description import fr3
from pretouch.robot.model import RobotModel

pytest_pycollect_makemodule = modules_with(FRANKA)


@pytest.fixture(scope="session")
def fr3_model():
    return RobotModel(fr3())


@pytest.fixture
def serve(tmp_path):
    """Starts simulated arms: of a kind, with more options of `pretouch serve-fci`."""
    opened: list[Served] = []

    def start(kind: str, *more: str) -> Served:
        opened.append(Served(tmp_path, kind, *more))
        return opened[-1]

    yield start
    for served in opened:
        served.close()
