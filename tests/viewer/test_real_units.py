"""Real units on the simulated arm: readings are as old in the simulation as they are in the room."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from tests.ports import free_port

from pretouch.errors import ParameterError
from pretouch.hardware.receiver_process import Traffic
from pretouch.hardware.traffic import ImuBatch, Received, UnitTraffic
from pretouch.hardware.wire import Flag, Sample
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.types import Mode, RangeReadings, RangeStatus
from pretouch.viewer.live import LivePage
from pretouch.viewer.real_units import RealUnits
from pretouch.viewer.server import ServeOptions, served
from pretouch.viewer.simulation import LiveSimulation
from pretouch.viewer.unit_panel import PERIOD_S, UnitPanel

UNITS = 7


def sample(sequence: int = 1, **fields: Any) -> Sample:
    usual = Sample(
        unit=1, flags=int(Flag.RANGE_NEW), sequence=sequence, time_us=20_000 * sequence, beacon=1, beacon_hold_us=0,
        battery_mv=3900, temperature_cdeg=2500, bus_errors=0, range_stream=sequence % 128, range_status=0,
        range_mm=500 + sequence % 5, range_age_us=10_000, range_sigma=12, range_signal=1000, range_ambient=3,
        range_spads=4096, imu_count=8, imu_scale=0x21, imu_rate_hz=416, imu_index=8 * sequence, imu_age_us=0,
    )  # fmt: skip
    return replace(usual, **fields)


class Room:
    """A machine's clock, and units in it that are heard whenever a test says so."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.readings = RangeReadings(
            np.full(UNITS, -np.inf), np.zeros(UNITS), np.full(UNITS, int(RangeStatus.NONE), dtype=np.int64)
        )
        self.alive = True
        self.imu: list[ImuBatch] = []
        self.samples: list[Received] = []
        self.units = tuple(UnitTraffic(f"unit_{k}", k + 1) for k in range(UNITS))

    def hear(self, distance: float = 0.9, age: float = 0.012) -> None:
        stamp = np.full(UNITS, self.now - age)
        self.readings = RangeReadings(stamp, np.full(UNITS, distance), np.zeros(UNITS, dtype=np.int64))

    def read(self) -> RangeReadings:
        return self.readings

    def take_imu(self) -> list[ImuBatch]:
        taken, self.imu = self.imu, []
        return taken

    def take_samples(self) -> list[Received]:
        taken, self.samples = self.samples, []
        return taken

    def traffic(self) -> Traffic:
        return Traffic(self.units, {}, 0)


@pytest.fixture
def room() -> Room:
    return Room()


@pytest.fixture
def real(room: Room) -> RealUnits:
    return RealUnits(room, clock=lambda: room.now)


def test_a_reading_is_as_old_in_the_simulation_as_in_the_room(room: Room, real: RealUnits) -> None:
    real.begin(lambda: 5.0)
    room.hear(age=0.012)
    np.testing.assert_allclose(real.read().stamp, 5.0 - 0.012, atol=1e-9)


def test_a_reading_keeps_the_stamp_it_was_given_however_fast_the_clocks_go(room: Room, real: RealUnits) -> None:
    time = [5.0]
    real.begin(lambda: time[0])
    room.hear()
    first = real.read().stamp
    room.now, time[0] = room.now + 1.0, 5.5  # at half speed
    np.testing.assert_array_equal(real.read().stamp, first)


def test_no_stamp_goes_back_while_the_simulation_stands(room: Room, real: RealUnits) -> None:
    real.begin(lambda: 5.0)
    room.hear(age=0.010)
    first = real.read().stamp
    room.now += 3.0
    room.hear(age=0.015)
    np.testing.assert_array_equal(real.read().stamp, first)


def test_what_was_never_heard_stays_unheard(room: Room, real: RealUnits) -> None:
    real.begin(lambda: 5.0)
    assert np.all(np.isneginf(real.read().stamp))


def test_imu_samples_are_stamped_in_the_simulations_time(room: Room, real: RealUnits) -> None:
    real.begin(lambda: 5.0)
    room.imu = [ImuBatch(2, np.array([room.now - 0.02, room.now - 0.01]), np.ones((2, 3)), np.zeros((2, 3)), 0)]
    (batch,) = real.take_imu()
    np.testing.assert_allclose(batch.stamp, [4.98, 4.99], atol=1e-9)


def test_imu_samples_that_would_overlap_in_a_slower_simulation_are_left_out(room: Room, real: RealUnits) -> None:
    time, stamps = [5.0], []
    real.begin(lambda: time[0])
    for _ in range(100):
        room.now, time[0] = room.now + 0.02, time[0] + 0.01
        at = room.now - np.arange(8)[::-1] / 416
        room.imu = [ImuBatch(0, at, np.ones((8, 3)), np.zeros((8, 3)), 0)]
        stamps += [batch.stamp for batch in real.take_imu()]
    kept = np.concatenate(stamps)
    assert np.diff(kept).min() > 0
    assert 300 < len(kept) < 600  # of 800, in half the time
    assert kept[-1] == pytest.approx(time[0], abs=0.06)


def test_an_arm_with_real_units_goes_while_they_are_heard_and_holds_when_they_are_not(
    room: Room, real: RealUnits
) -> None:
    simulation = LiveSimulation(real=real)
    for _ in range(200):
        room.now += 0.01
        room.hear()
        step = simulation.single_step()
    assert step.mode is Mode.TRACK
    np.testing.assert_array_equal(step.range_distance, np.full(UNITS, 0.9))
    for _ in range(40):
        room.now += 0.01
        step = simulation.single_step()
    assert step.mode is Mode.HOLD
    assert step.reason.startswith("No usable reading from ")
    for _ in range(40):
        room.now += 0.01
        room.hear()
        step = simulation.single_step()
    assert step.mode is Mode.TRACK


def test_real_units_cannot_be_made_to_fail_but_can_be_reset(room: Room, real: RealUnits) -> None:
    simulation = LiveSimulation(real=real)
    with pytest.raises(ParameterError, match="units are real: unplug or cover one"):
        simulation.set_faults(frozenset({"hand_left"}))
    simulation.advance(0.5)
    room.hear()
    simulation.reset()
    np.testing.assert_allclose(simulation.frame.age, 0.012, atol=1e-9)


def test_readings_and_imu_of_real_units_are_recorded_and_verify(room: Room, real: RealUnits, tmp_path) -> None:
    simulation = LiveSimulation(real=real)
    simulation.start_recording(tmp_path / "desk.mcap")
    for _ in range(50):
        room.now += 0.01
        room.hear()
        room.imu = [ImuBatch(0, np.array([room.now]), np.full((1, 3), 9.8), np.zeros((1, 3)), 0)]
        simulation.single_step()
    simulation.stop_recording()
    recorded = open_recording(tmp_path / "desk.mcap")
    assert recorded.runs[0].about["units"] == "real"
    verdict = verify(recorded)
    assert verdict.agrees
    assert verdict.checked >= 49


class _Html:
    content = ""


class _Gui:
    def add_html(self, content: str) -> _Html:
        self.html = _Html()
        return self.html


def test_the_panel_shows_each_unit_and_what_is_wrong_with_it(room: Room) -> None:
    gui = _Gui()
    panel = UnitPanel(gui, room, tuple(unit.id for unit in room.units))  # type: ignore[arg-type]
    panel.draw(room.now)
    assert "unit_0 has sent nothing so far" in gui.html.content
    room.units[0].state, room.units[0].accepted = "live", 500
    arrivals = room.now + 0.02 * np.arange(500)
    room.samples = [Received(0, t, t - 0.012, 0.0, 0.001, sample(k + 1)) for k, t in enumerate(arrivals.tolist())]
    room.units[0].last_arrival = float(arrivals[-1])
    panel.draw(float(arrivals[-1]))
    html = gui.html.content
    assert "<b>unit_0</b> 50 Hz · 0 % lost · 12 ms · 3.90 V" in html
    assert "unit_1 has sent nothing so far" in html
    panel.draw(float(arrivals[-1]) + 0.9 * PERIOD_S)
    assert gui.html.content == html


@contextmanager
def page_of(simulation: LiveSimulation, say: Callable[[str], None] = lambda line: None) -> Iterator[LivePage]:
    with served(ServeOptions(port=free_port()), "test") as server:
        yield LivePage(server, simulation, say)


def test_a_pause_while_recording_ends_no_recording_and_leaves_its_imu_samples_out(
    room: Room, real: RealUnits, tmp_path: Path
) -> None:
    simulation = LiveSimulation(real=real)
    begun = simulation.time
    simulation.start_recording(tmp_path / "desk.mcap")
    with page_of(simulation) as page:
        for turn in range(100):
            page.controls.running.paused = 30 <= turn < 60
            passed = 1.0 if page.controls.running.paused else 1 / 30
            room.now += passed
            room.hear()
            count = round(2900 * passed)
            stamps = room.now - np.arange(count)[::-1] / 2900
            room.imu = [ImuBatch(0, stamps, np.zeros((count, 3)), np.zeros((count, 3)), 0)]
            page.turn(room.now)
    closed = simulation.stop_recording()
    assert closed is not None
    assert "ended early" not in closed.sentence
    with (tmp_path / "desk.mcap").open("rb") as file:
        times = [m.log_time for _, c, m in make_reader(file).iter_messages() if c.topic == "/skin/hand_left/imu"]
    assert min(times) > 0
    spacing = np.diff(times)
    assert np.median(spacing) == pytest.approx(1e9 / 2900, rel=0.01)
    assert len(times) == pytest.approx(2900 * (simulation.time - begun), abs=200)


def test_a_receiver_that_has_ended_is_said_once(room: Room, real: RealUnits) -> None:
    said: list[str] = []
    simulation = LiveSimulation(real=real)
    with page_of(simulation, said.append) as page:
        page.turn(0.0)
        assert not said
        room.alive = False
        for turn in range(10):
            page.turn(turn / 30)
        assert page.notice == "The receiver of the sensor units has ended: start the page again."
    assert said == [page.notice]
