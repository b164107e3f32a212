"""The scene with two arms: both move, each told where the other is, and the page shows both."""

import numpy as np
import pytest
from tests.ports import free_port

from pretouch.cli import main
from pretouch.profiles import profile
from pretouch.types import Mode
from pretouch.viewer.live import PERIOD_S, LivePage
from pretouch.viewer.room import LiveSettings
from pretouch.viewer.server import ServeOptions, served
from pretouch.viewer.simulation import LiveSimulation

TWO = LiveSettings(profile=profile("pretouch"), scene="two-arms")


def test_an_unknown_scene_is_refused_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["live", "--scene", "three", "--port", str(free_port())]) == 2
    assert capsys.readouterr().err == "The scene is 'three': choose one-arm or two-arms.\n"


@pytest.mark.slow
def test_both_move_and_give_way_until_a_reset_brings_them_back() -> None:
    simulation = LiveSimulation(TWO)
    begun = simulation.across.cycle.step.q
    for step in simulation.advance(8.0):
        across = simulation.across.cycle.step
        assert np.isinf(step.obstacles.ee_distance).sum() == len(simulation.model.parts)
        assert simulation.frame.true_force.max() == 0.0
    assert (step.mode, across.mode) == (Mode.TRACK, Mode.TRACK)
    assert min(step.path_phase, across.path_phase) > 1.0
    assert across.stamp == step.stamp
    simulation.reset()
    assert simulation.across.cycle.step.q == pytest.approx(begun, abs=1e-3)
    assert LiveSimulation(LiveSettings(profile=TWO.profile)).across is None


@pytest.mark.slow
def test_the_page_draws_both() -> None:
    simulation = LiveSimulation(TWO)
    with served(ServeOptions(port=free_port()), "Pretouch") as server:
        page = LivePage(server, simulation)
        for i in range(10):
            page.turn(i * PERIOD_S)
        page._draw(1.0)
        drawn = server.scene._handle_from_node_name
        link = next(name for name in drawn if name.startswith("/across/arm/") and name.endswith("link7"))
        kin = simulation.model.kinematics(simulation.across.cycle.step.q)
        index = simulation.model.link_index(link.rpartition("/")[2])
        assert drawn[link].position == pytest.approx(kin.position[index], abs=1e-6)
