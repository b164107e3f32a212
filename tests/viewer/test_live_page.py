"""The live page without a browser: what it does between two ticks."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from tests.viewer.browser import free_port

from pretouch.recording.reader import open_recording
from pretouch.types import Mode
from pretouch.viewer.live import PERIOD_S, LivePage, serve_live
from pretouch.viewer.server import ServeOptions, served
from pretouch.viewer.simulation import LiveSimulation

pytest.importorskip("viser", reason="the page needs the extra 'viewer'")


class Clock:
    """Turns a page at 30 Hz of a time of its own."""

    def __init__(self, page: LivePage) -> None:
        self.page, self.now = page, 0.0

    def turn(self, seconds: float) -> None:
        for _ in range(round(seconds / PERIOD_S)):
            self.now += PERIOD_S
            self.page.turn(self.now)


@pytest.fixture
def simulation() -> LiveSimulation:
    return LiveSimulation()


@pytest.fixture
def clock(simulation: LiveSimulation) -> Iterator[Clock]:
    with served(ServeOptions(port=free_port()), "test") as server:
        yield Clock(LivePage(server, simulation))


def test_a_second_of_ticks_is_a_second_of_the_simulation(clock: Clock, simulation: LiveSimulation) -> None:
    before = simulation.time
    clock.turn(1.0)
    assert simulation.time - before == pytest.approx(1.0, abs=0.011)


def test_slow_motion_and_pause(clock: Clock, simulation: LiveSimulation) -> None:
    before = simulation.time
    clock.page.controls.running.speed = 0.1
    clock.turn(2.0)
    assert simulation.time - before == pytest.approx(0.2, abs=0.011)
    clock.page.controls.running.paused = True
    before = simulation.time
    clock.turn(1.0)
    assert simulation.time == before
    clock.page.controls.running.single = True
    clock.turn(1.0)
    assert simulation.time - before == pytest.approx(0.01)


def test_what_people_ask_for_waits_for_the_loop(clock: Clock, simulation: LiveSimulation) -> None:
    page = clock.page
    page.ask(lambda: simulation.move_hand(np.array([0.9, 0.3, 0.6])), "hand")
    assert simulation.frame.hand_target is not None
    assert not np.allclose(simulation.frame.hand_target, [0.9, 0.3, 0.6])
    clock.turn(0.1)
    np.testing.assert_allclose(simulation.frame.hand_target, [0.9, 0.3, 0.6])


def test_what_is_refused_is_said_and_changes_nothing(clock: Clock, simulation: LiveSimulation) -> None:
    before = simulation.world.profile
    clock.page.ask(lambda: simulation.set_speed(-1.0))
    clock.turn(0.1)
    assert clock.page.notice.startswith("Not done: TaskParams.speed_m_s is -1")
    assert simulation.world.profile == before


def test_a_reset_begins_anew(clock: Clock, simulation: LiveSimulation) -> None:
    clock.turn(2.0)
    clock.page.ask(simulation.reset)
    clock.turn(0.1)
    assert simulation.time < 1.0
    assert simulation.frame.step.mode is Mode.HOLD


def test_another_object_is_another_world(clock: Clock, simulation: LiveSimulation) -> None:
    clock.page.ask(lambda: simulation.reset(object="board -y"))
    clock.turn(0.1)
    assert len(simulation.world.boxes) == 1


def test_nobody_watching_costs_nothing_but_the_simulation(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[float] = []
    monkeypatch.setattr(LivePage, "_draw", lambda self, now: drawn.append(now))
    clock.turn(0.5)
    assert drawn == []


def test_the_address_is_the_one_line_that_is_said(
    simulation: LiveSimulation, capfd: pytest.CaptureFixture[str]
) -> None:
    options, turns = ServeOptions(port=free_port()), iter([False, False, True])
    serve_live(simulation, options, until=lambda: next(turns))
    assert capfd.readouterr().out == f"The arm is at http://127.0.0.1:{options.port} (Ctrl-C ends it).\n"


def test_however_it_ends_a_recording_is_closed_and_named(simulation: LiveSimulation, tmp_path: Path) -> None:
    def interrupted() -> bool:
        raise KeyboardInterrupt

    simulation.start_recording(tmp_path / "session.mcap")
    said: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        serve_live(simulation, ServeOptions(port=free_port()), interrupted, said.append)
    assert simulation.recording is None
    assert str(tmp_path / "session.mcap") in said[-1]


def test_a_page_that_is_open_for_long_keeps_no_more_and_more(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    server = clock.page._server
    monkeypatch.setattr(server, "get_clients", lambda: {0: None})
    kept = server._websock_server._broadcast_buffer.message_from_id
    clock.turn(6.0)
    after_a_while = len(kept)
    clock.turn(4.0)
    assert len(kept) <= after_a_while + 10


def test_each_recording_gets_a_file_of_its_own_that_is_named(
    clock: Clock, simulation: LiveSimulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for number in (1, 2):
        clock.page.ask(clock.page.controls.toggle_recording)
        clock.turn(0.3)
        assert clock.page.notice == f"Recording to runs/live-{number}.mcap."
        clock.page.ask(clock.page.controls.toggle_recording)
        clock.turn(0.1)
        assert f"runs/live-{number}.mcap" in clock.page.notice
        assert len(open_recording(Path(f"runs/live-{number}.mcap"))) >= 25


def test_a_folder_for_recordings_that_cannot_be_made_is_said(
    clock: Clock, simulation: LiveSimulation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("runs").write_text("in the way")
    clock.page.ask(clock.page.controls.toggle_recording)
    clock.turn(0.1)
    assert clock.page.notice == "Not done: The folder runs cannot be made: File exists."
    assert simulation.recording is None
