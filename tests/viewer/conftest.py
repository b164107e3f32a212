import pytest

from pretouch.types import ControlStep
from pretouch.viewer.simulation import LiveSimulation


@pytest.fixture(scope="session")
def some_step() -> ControlStep:
    """A step of an arm on its path."""
    simulation = LiveSimulation()
    simulation.advance(1.5)
    return simulation.frame.step
