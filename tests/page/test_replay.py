"""The page of a recording, without a browser."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.ports import free_port

from pretouch.page.replay import Player, ReplayPage, Timeline, frame_of, show_replay, world_of
from pretouch.page.server import ServeOptions, begun, url_of
from pretouch.page.simulation import LiveSimulation
from pretouch.profiles import PROFILES
from pretouch.recording.reader import open_recording
from pretouch.types import Contact, Mode

STAMPS = 100.0 + np.arange(101) / 100


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    place: Path = tmp_path_factory.mktemp("recorded") / "session.mcap"
    simulation = LiveSimulation()
    simulation.reset(object="board +y")
    simulation.start_recording(place)
    simulation.advance(2.0)
    simulation.set_path("line")
    simulation.advance(1.0)
    simulation.stop_recording()
    return open_recording(place)


def test_the_world_of_a_recording_is_the_one_it_was_made_in(recorded):
    first, second = (world_of(run) for run in recorded.runs)
    assert first.profile == PROFILES["paper"]
    assert len(first.boxes) == 1
    assert first.boxes[0].center.shape == (3,)
    assert first.hand_radius == 0.05
    assert first.floor_height == -0.2
    assert first.skin.ids == LiveSimulation().skin.ids
    assert not second.path.closed or second.path.length != first.path.length


def test_a_frame_shows_what_was_recorded_and_knows_how_old_the_readings_were(recorded):
    cycle = recorded[100]
    frame = frame_of(cycle)
    assert frame.step.stamp == cycle.step.stamp
    np.testing.assert_array_equal(frame.hand, cycle.truth.hand)
    np.testing.assert_array_equal(frame.true_force, cycle.truth.force[-1])
    assert frame.hand_target is None
    np.testing.assert_array_equal(frame.age, cycle.step.stamp - cycle.inputs.readings.stamp)
    assert np.all((frame.age >= 0.0) & (frame.age < 0.1))
    assert frame_of(replace(cycle, inputs=None)).age is None
    assert not frame_of(replace(cycle, inputs=None)).late(0.0).any()


def test_playing_and_jumping_show_the_steps_at_that_time(server, recorded):
    page = ReplayPage(server, recorded)
    page.player.play()
    for i in range(30):
        page.turn(i / 30, 1 / 30)
    assert page.draw(1.0).step.stamp == pytest.approx(recorded[0].step.stamp + 1.0, abs=0.02)
    page.player.seek(2.5)
    assert page.draw(2.0).run == 1
    time = page.history.column("time")  # after a jump the plots begin ten seconds before, or at the start
    assert time[0] == pytest.approx(0.0, abs=0.05)
    assert time[-1] == pytest.approx(2.5, abs=0.1)
    assert page.run_name(1) == "profile paper, part 2 of 2, path of 2.00 m"
    page.player.seek(0.0)
    assert page.draw(3.0).step.mode is Mode.HOLD


def test_the_address_is_said_and_the_page_ends_when_told(recorded, capfd):
    options, turns = ServeOptions(port=free_port()), iter([False, True])
    with begun(options, "test", "The recording", "see it", print) as ready:
        assert capfd.readouterr().out == f"The recording is at {url_of(options)} (Ctrl-C ends it).\n"
        server = ready()
        handles = server.gui._gui_input_handle_from_uuid.values()
        assert not [handle for handle in handles if "is being read" in str(getattr(handle, "content", ""))]
        show_replay(recorded, server, until=lambda: next(turns))


def test_whatever_fails_in_the_page_it_plays_no_further_and_it_is_said_once(server, recorded, monkeypatch):
    def fail(*_: object) -> None:
        raise KeyError("nosuch")

    monkeypatch.setattr(ReplayPage, "turn", fail)
    turns, lines = iter([False, False, True]), []
    show_replay(recorded, server, until=lambda: next(turns), say=lines.append)
    assert lines == ["The page failed, and holds: KeyError: 'nosuch'. Please report this."]


# where in a recording a page is, and what happened there


def test_playing_takes_as_long_as_it_took_and_a_paused_player_stands():
    player = Player(STAMPS)
    player.advance(1.0)
    assert player.index == 0
    player.play()
    for _ in range(15):
        player.advance(1 / 30)
    assert player.time == pytest.approx(0.5)
    assert player.index == 50
    player.speed = 2.0
    for _ in range(15):
        player.advance(1 / 30)
    assert not player.playing
    assert player.index == 100


def test_from_the_end_it_plays_from_the_start():
    player = Player(STAMPS)
    player.seek(9.0)
    assert player.time == pytest.approx(1.0)
    player.play()
    assert player.time == 0.0


@pytest.mark.parametrize("index", range(0, 101, 7))
def test_steps_on_and_back_are_single_and_pause(index):
    player = Player(STAMPS)
    player.play()
    for by, place in ((0, index), (1, min(index + 1, 100)), (-1, min(index, 99)), (-1, max(min(index, 99) - 1, 0))):
        player.seek_index(index if by == 0 else player.index + by)
        assert (player.index, player.playing) == (place, False)


def test_what_happened_is_found_bit_by_bit(some_step):
    contact = Contact(np.array([12.0, 0.0, 0.0]), np.array([True, False, False]))
    moves = {"reaction_velocity": np.array([0.1, 0.0, 0.0]), "command": np.full(7, 0.1)}
    steps = [
        replace(some_step, mode=Mode.REACT if 40 <= i < 60 else Mode.TRACK, contact=contact if i == 40 else None)
        for i in range(100)
    ]
    steps[45] = replace(steps[45], **moves)
    timeline = Timeline(steps.__getitem__, len(steps))
    timeline.search(45)
    assert [event.index for event in timeline.events] == [40]
    assert timeline.share == 0.45
    timeline.search(100)
    assert timeline.share == 1.0
    assert [(event.index, event.what) for event in timeline.events] == [
        (40, "Contact of 12.0 N"),
        (60, "REACT to TRACK"),
    ]
    first, second = timeline.events
    assert timeline.after(0) is first
    assert timeline.after(40) is second
    assert timeline.after(60) is None
    assert timeline.before(60) is first
    assert timeline.before(40) is None


def test_a_contact_that_did_not_move_the_arm_is_told_as_it_ends(some_step):
    contact = Contact(np.array([6.0, 0.0, 0.0]), np.array([True, False, False]))
    still = replace(some_step, mode=Mode.REACT, command=np.zeros(7), reaction_velocity=np.zeros(3))
    steps = [some_step, replace(still, contact=contact), still, some_step]
    timeline = Timeline(steps.__getitem__, len(steps))
    timeline.search(4)
    contact_words, end = (event.what for event in timeline.events)
    assert contact_words == "Contact of 6.0 N"
    assert end == "REACT to TRACK, after a contact that did not move the arm"
