"""Real units on the simulated arm: readings are as old in the simulation as they are in the room."""

import numpy as np
import pytest

from pretouch.errors import ParameterError
from pretouch.page.live import LivePage
from pretouch.page.real_units import RealUnits
from pretouch.page.simulation import LiveSimulation
from pretouch.recording.reader import open_recording
from pretouch.recording.verify import verify
from pretouch.types import Mode, RangeReadings, RangeStatus

UNITS = 7


class Room:
    """A machine's clock, and units in it that are heard whenever a test says so."""

    def __init__(self) -> None:
        self.now = 1000.0
        self.readings = RangeReadings(
            np.full(UNITS, -np.inf), np.zeros(UNITS), np.full(UNITS, int(RangeStatus.NONE), dtype=np.int64)
        )
        self.alive = True

    def hear(self, distance: float = 0.9, age: float = 0.012) -> None:
        stamp = np.full(UNITS, self.now - age)
        self.readings = RangeReadings(stamp, np.full(UNITS, distance), np.zeros(UNITS, dtype=np.int64))

    def read(self) -> RangeReadings:
        return self.readings


@pytest.fixture
def room():
    return Room()


@pytest.fixture
def real(room):
    return RealUnits(room, clock=lambda: room.now)


def test_a_reading_is_as_old_in_the_simulation_as_in_the_room_and_keeps_its_stamp_however_fast_the_clocks_go(
    room, real
):
    time = [5.0]
    real.begin(lambda: time[0])
    assert np.all(np.isneginf(real.read().stamp)), "what was never heard stays unheard"
    room.hear(age=0.012)
    first = real.read().stamp
    np.testing.assert_allclose(first, 5.0 - 0.012, atol=1e-9)
    room.now, time[0] = room.now + 1.0, 5.5  # at half speed
    np.testing.assert_array_equal(real.read().stamp, first)


def test_no_stamp_goes_back_while_the_simulation_stands(room, real):
    real.begin(lambda: 5.0)
    room.hear(age=0.010)
    first = real.read().stamp
    room.now += 3.0
    room.hear(age=0.015)
    np.testing.assert_array_equal(real.read().stamp, first)


def test_an_arm_with_real_units_goes_while_they_are_heard_and_holds_when_they_are_not_and_all_is_recorded(
    room, real, tmp_path
):
    simulation = LiveSimulation(real=real)
    simulation.start_recording(tmp_path / "desk.mcap")
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
    simulation.stop_recording()
    recorded = open_recording(tmp_path / "desk.mcap")
    assert recorded.runs[0].about["units"] == "real"
    verdict = verify(recorded)
    assert verdict.agrees
    assert verdict.checked == 280


def test_real_units_cannot_be_made_to_fail_but_can_be_reset(room, real):
    simulation = LiveSimulation(real=real)
    with pytest.raises(ParameterError, match="units are real: unplug or cover one"):
        simulation.silence(frozenset({"hand_left"}))
    simulation.advance(0.5)
    room.hear()
    simulation.reset()
    np.testing.assert_allclose(simulation.frame.age, 0.012, atol=1e-9)


def test_a_receiver_that_has_ended_is_said_once(server, room, real):
    lines: list[str] = []
    page = LivePage(server, LiveSimulation(real=real), lines.append)
    page.turn(0.0)
    assert not lines
    room.alive = False
    for turn in range(10):
        page.turn(turn / 30)
    assert page.status.notice == "The receiver of the sensor units has ended: start the page again."
    assert lines == [page.status.notice]
