"""The page of a recording, without a browser."""

from pathlib import Path

import numpy as np
import pytest
from tests.viewer.browser import free_port

from pretouch.params import PROFILES
from pretouch.recording.compare import compare
from pretouch.recording.reader import Recorded, open_recording
from pretouch.types import Mode
from pretouch.viewer.replay import ReplayPage, frame_of, serve_replay, world_of
from pretouch.viewer.server import ServeOptions, served
from pretouch.viewer.simulation import LiveSimulation

pytest.importorskip("viser", reason="the page needs the extra 'viewer'")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    place: Path = tmp_path_factory.mktemp("recorded") / "session.mcap"
    simulation = LiveSimulation()
    simulation.reset(object="board +y")
    simulation.start_recording(place)
    simulation.advance(2.0)
    simulation.set_path("line")
    simulation.advance(1.0)
    simulation.stop_recording()
    return open_recording(place)


def test_the_world_of_a_recording_is_the_one_it_was_made_in(recorded: Recorded) -> None:
    first, second = (world_of(run) for run in recorded.runs)
    assert first.profile == PROFILES["paper"]
    assert len(first.boxes) == 1
    assert first.boxes[0].center.shape == (3,)
    assert first.hand_radius == 0.05
    assert first.floor_height == -0.2
    assert first.skin.ids == LiveSimulation().skin.ids
    assert not second.path.closed or second.path.length != first.path.length


def test_a_frame_shows_what_was_recorded(recorded: Recorded) -> None:
    kept = recorded[100]
    frame = frame_of(kept)
    assert kept.truth is not None
    assert frame.step.stamp == kept.step.stamp
    np.testing.assert_array_equal(frame.hand, kept.truth.hand)
    np.testing.assert_array_equal(frame.true_force, kept.truth.force[-1])
    assert frame.hand_target is None


@pytest.mark.parametrize("other", ["", "blind"])
def test_playing_and_jumping_show_the_steps_at_that_time(recorded: Recorded, other: str) -> None:
    comparison = compare(recorded, PROFILES[other]) if other else None
    with served(ServeOptions(port=free_port()), "test") as server:
        page = ReplayPage(server, recorded, comparison)
        page.player.play()
        for i in range(30):
            page.turn(i / 30, 1 / 30)
        assert page.draw(1.0).step.stamp == pytest.approx(recorded[0].step.stamp + 1.0, abs=0.02)
        page.player.seek(2.5)
        assert page.draw(2.0).run == 1
        page.player.seek(0.0)
        assert page.draw(3.0).step.mode is Mode.HOLD


def test_the_address_is_said_and_the_page_ends_when_told(recorded: Recorded, capfd: pytest.CaptureFixture[str]) -> None:
    options, turns = ServeOptions(port=free_port()), iter([False, True])
    serve_replay(recorded, options, until=lambda: next(turns))
    assert capfd.readouterr().out == f"The recording is at http://127.0.0.1:{options.port} (Ctrl-C ends it).\n"
