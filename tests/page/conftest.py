"""A live session, and a page that is served with nobody at it yet."""

from collections.abc import Callable, Iterator

import pytest
from tests.page.fake_scene import FakeScene
from tests.page.visitor import Visitor
from tests.ports import free_port
from viser import ViserServer

from pretouch.page.live import LivePage
from pretouch.page.room import LiveSettings
from pretouch.page.server import ServeOptions, served
from pretouch.page.simulation import LiveSimulation
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep


@pytest.fixture(scope="session")
def some_step() -> ControlStep:
    """A step of an arm on its path."""
    simulation = LiveSimulation()
    simulation.advance(1.5)
    return simulation.frame.step


@pytest.fixture
def live(panda_model: RobotModel, paper_skin: Skin) -> Callable[..., LiveSimulation]:
    """Begin a session with some settings."""
    return lambda **settings: LiveSimulation(LiveSettings(**settings), panda_model, paper_skin)


@pytest.fixture
def simulation() -> LiveSimulation:
    return LiveSimulation()


@pytest.fixture
def options() -> ServeOptions:
    return ServeOptions(port=free_port())


@pytest.fixture
def server(options: ServeOptions) -> Iterator[ViserServer]:
    with served(options, "test") as running:
        yield running


@pytest.fixture
def page(server: ViserServer, simulation: LiveSimulation) -> LivePage:
    return LivePage(server, simulation)


@pytest.fixture
def visitor(page: LivePage, server: ViserServer, options: ServeOptions) -> Iterator[Visitor]:
    """Somebody at the page."""
    with Visitor(server, options) as somebody:
        yield somebody


@pytest.fixture
def fake() -> FakeScene:
    return FakeScene()
