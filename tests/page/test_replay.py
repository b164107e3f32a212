"""The page of a recording, without a browser."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.ports import free_port
from viser import ViserServer

from pretouch.page.replay import ReplayPage, frame_of, show_replay, world_of
from pretouch.page.server import ServeOptions, begun, url_of
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES
from pretouch.recording.reader import Recorded, open_recording
from pretouch.types import Mode


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


def test_a_frame_shows_what_was_recorded_and_knows_how_old_the_readings_were(recorded: Recorded) -> None:
    kept = recorded[100]
    frame = frame_of(kept)
    assert frame.step.stamp == kept.step.stamp
    np.testing.assert_array_equal(frame.hand, kept.truth.hand)
    np.testing.assert_array_equal(frame.true_force, kept.truth.force[-1])
    assert frame.hand_target is None
    np.testing.assert_array_equal(frame.age, kept.step.stamp - kept.inputs.readings.stamp)
    assert np.all((frame.age >= 0.0) & (frame.age < 0.1))
    assert frame_of(replace(kept, inputs=None)).age is None
    assert not frame_of(replace(kept, inputs=None)).late(0.0).any()


def test_playing_and_jumping_show_the_steps_at_that_time(server: ViserServer, recorded: Recorded) -> None:
    page = ReplayPage(server, recorded)
    page.player.play()
    for i in range(30):
        page.turn(i / 30, 1 / 30)
    assert page.draw(1.0).step.stamp == pytest.approx(recorded[0].step.stamp + 1.0, abs=0.02)
    page.player.seek(2.5)
    assert page.draw(2.0).run == 1
    time = page.history.columns()[0]  # after a jump the plots begin ten seconds before, or at the start
    assert time[0] == pytest.approx(0.0, abs=0.05)
    assert time[-1] == pytest.approx(2.5, abs=0.1)
    assert page.run_name(1) == "profile paper, part 2 of 2, path of 2.00 m"
    page.player.seek(0.0)
    assert page.draw(3.0).step.mode is Mode.HOLD


def test_the_address_is_said_and_the_page_ends_when_told(recorded: Recorded, capfd: pytest.CaptureFixture[str]) -> None:
    options, turns = ServeOptions(port=free_port()), iter([False, True])
    with begun(options, "test", "The recording", "see it", print) as ready:
        assert capfd.readouterr().out == f"The recording is at {url_of(options)} (Ctrl-C ends it).\n"
        server = ready()
        assert not [handle for handle in contents(server) if "is being read" in handle]
        show_replay(recorded, server, until=lambda: next(turns))


def contents(server: ViserServer) -> list[str]:
    handles = server.gui._gui_input_handle_from_uuid.values()
    return [str(getattr(handle, "content", "")) for handle in handles]


def test_whatever_fails_in_the_page_it_plays_no_further_and_it_is_said_once(
    server: ViserServer, recorded: Recorded, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise KeyError("nosuch")

    monkeypatch.setattr(ReplayPage, "turn", fail)
    turns, said = iter([False, False, True]), []
    show_replay(recorded, server, until=lambda: next(turns), say=said.append)
    assert said == ["The page failed, and holds: KeyError: 'nosuch'. Please report this."]
