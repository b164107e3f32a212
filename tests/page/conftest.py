"""A live session, and a page that is served with nobody at it yet."""

import pytest
from tests.page.fake_scene import FakeScene
from tests.page.visitor import Visitor
from tests.ports import free_port

from pretouch.page.live import LivePage
from pretouch.page.room import LiveSettings
from pretouch.page.server import ServeOptions, served
from pretouch.page.simulation import LiveSimulation


@pytest.fixture(scope="session")
def some_step():
    """A step of an arm on its path."""
    simulation = LiveSimulation()
    simulation.advance(1.5)
    return simulation.frame.step


@pytest.fixture
def live(panda_model, paper_skin):
    """Begin a session with some settings."""
    return lambda **settings: LiveSimulation(LiveSettings(**settings), panda_model, paper_skin)


@pytest.fixture
def simulation():
    return LiveSimulation()


@pytest.fixture
def options():
    return ServeOptions(port=free_port())


@pytest.fixture
def server(options):
    with served(options, "test") as running:
        yield running


@pytest.fixture
def page(server, simulation):
    return LivePage(server, simulation)


@pytest.fixture
def visitor(page, server, options):
    """Somebody at the page."""
    with Visitor(server, options) as somebody:
        yield somebody


@pytest.fixture
def fake():
    return FakeScene()
