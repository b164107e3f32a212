"""The life of a unit on a fake chip."""

import json
import os
import socket
import sys

import esp
import machine
import network
import service
from board import Esp32C3, Esp8266
from clock import Clock
from config import Config
from fake_bus import Bus as FakeBus
from fake_bus import Clock as FakeClock
from fake_lsm6ds3 import FakeLsm6ds3
from fake_receiver import FakeReceiver, FakeTime
from fake_vl53l1x import FakeVl53l1x
from lsm6ds3 import LSM6DS3
from vl53l1x import VL53L1X

os.chdir(sys.path[0])
KEY = "00112233445566778899aabbccddeeff" * 2
CONFIG = {
    "unit": 7, "key": KEY, "ssid": "net", "password": "password", "host": "10.0.0.1", "port": 4950,
    "battery_full_mv": 0, "sensor": "vl53l1x", "zones": 1, "touch_ohm": 0, "touch_least_mn": 500, "touch_mn_per_us": 10,
}  # fmt: skip
SECOND = 1_000_000


class _Enough(BaseException):
    """The test has seen enough of an endless loop."""


class _Draw(Esp8266):
    """An ESP8266; not every interpreter that tests run in has `os.urandom`."""

    drawn = 0

    def draw(self, size):
        _Draw.drawn += 1
        return bytes([_Draw.drawn & 0xFF] * size)


class _Time(FakeTime):
    """The module `time` of a chip: sleeping lets time pass, `events` happen, and the watchdog look."""

    def __init__(self, clock):
        super().__init__(clock)
        self.clock = clock
        self.events = []

    def sleep_ms(self, ms):
        self.clock.sleep_ms(ms)
        machine.state.check_watchdog()
        while self.events and self.events[0][0] <= self.clock.now_us:
            self.events.pop(0)[1]()


class _Chip:
    """Everything a unit finds on its board, in a network with its receiver."""

    def __init__(self):
        machine.state.__init__()
        network.state.__init__()
        self.now = machine.state.clock = FakeClock()
        self.bus = machine.state.bus = FakeBus(self.now)
        self.vl53l1x, self.lsm6ds3 = FakeVl53l1x(self.now), FakeLsm6ds3(self.now)
        self.bus.add(self.vl53l1x)
        self.bus.add(self.lsm6ds3)
        self.receiver = socket.state.receiver = FakeReceiver(7, bytes(Config(CONFIG).key))
        self.time = service.time = _Time(self.now)
        sleep, ticks = self.now.sleep_ms, self.now.ticks_us
        service.VL53L1X = lambda i2c: VL53L1X(i2c, 0x29, sleep)
        service.LSM6DS3 = lambda i2c: LSM6DS3(i2c, None, sleep, ticks, FakeTime.ticks_diff)
        self._beacon(SECOND // 2)

    def _beacon(self, at):
        def answer():
            if self.receiver.hellos and network.state.joined:
                fresh = self.receiver.session is None or self.receiver.challenge != self.receiver._of
                (self.receiver.open if fresh else self.receiver.go_on)()
            self._beacon(at + SECOND // 2)

        self.at(at, answer)

    def at(self, us, action):
        self.time.events.append((us, action))
        self.time.events.sort(key=lambda event: event[0])

    def serve(self, until_us):
        self.at(until_us, _enough)
        try:
            service.serve(_Draw(), Clock(self.time), Config(CONFIG))
        except _Enough:
            return self.receiver.samples
        raise AssertionError("it ended by itself")


def _enough():
    raise _Enough


def _set_there(there):
    def change():
        network.state.there = there

    return change


def a_touch_sensor_is_looked_at_on_a_board_that_has_a_pin_for_it():
    told = dict(CONFIG, touch_ohm=3300, touch_least_mn=500, touch_mn_per_us=10)
    machine.state.__init__()
    clock = Clock(FakeTime(FakeClock()))
    touch = service.touch_of(Esp32C3(), clock, Config(told))
    touch.step(clock.ticks())
    assert touch.new, "1250 mV at the pin"
    assert service.touch_of(Esp32C3(), clock, Config(CONFIG)) is None
    board = _Draw()
    assert service.touch_of(board, clock, Config(told)) is None
    assert board.noted() == "this board has no pin for a touch sensor"


def it_joins_and_says_50_samples_a_second():
    chip = _Chip()
    samples = chip.serve(5 * SECOND)
    assert network.state.asked == ("net", "password")
    assert socket.state.sent_to == {("10.0.0.1", 4950)}
    assert 200 <= len(samples) <= 250
    assert sum(s["flags"] & 1 for s in samples) > 190
    assert machine.state.hz == 160_000_000


def a_network_lost_and_back_is_no_end():
    chip = _Chip()
    chip.at(3 * SECOND, _set_there(False))
    chip.at(9 * SECOND, _set_there(True))
    samples = chip.serve(14 * SECOND)
    assert 300 < len(samples) < 500
    assert samples[-1]["time_us"] > 13.9 * SECOND
    assert len({hello[3] for hello in chip.receiver.hellos}) == 2, "a session before, a session after"


def sensors_that_are_not_there_are_no_end():
    chip = _Chip()
    chip.vl53l1x.power_off()
    chip.lsm6ds3.power_off()
    samples = chip.serve(4 * SECOND)
    assert len(samples) > 130, len(samples)
    assert samples[-1]["flags"] == 2 | 4 | 64


def a_call_that_never_returns_lets_the_watchdog_bite():
    chip = _Chip()

    def hang(*_, **__):
        while True:
            chip.time.sleep_ms(100)

    def break_bus():
        chip.bus.readfrom_mem_into = hang

    chip.at(2 * SECOND, break_bus)
    assert _reset_in(lambda: chip.serve(10 * SECOND)) == "watchdog"
    assert 5 * SECOND <= chip.now.now_us < 5.3 * SECOND


lines = []
"""What the unit printed."""


def _configure():
    with open("config.json", "w") as file:
        file.write(json.dumps(CONFIG))


def _run(board):
    service.this_board = lambda: board
    service.print = lambda *words: lines.append(" ".join(map(str, words)))
    return _reset_in(service.run)


def _reset_in(run):
    try:
        run()
    except machine.Reset as error:
        return str(error)
    raise AssertionError("it went on")


def an_error_nobody_expected_is_noted_and_the_unit_begins_anew():
    _Chip()
    _configure()
    board = _Draw()

    def fail():
        raise MemoryError("of no use")

    board.open_wlan = fail
    assert _run(board) == "machine.reset"
    assert "MemoryError" in board.noted()
    assert "of no use" in board.noted()
    assert KEY not in board.noted()
    assert "password" not in board.noted()


def a_note_may_be_any_bytes():
    board = Esp8266()
    machine.state.memory = b"\xff\xfe"
    assert board.noted() == ""
    board.note("x" * 1000 + "end")
    assert board.noted() == "x" * 197 + "end"


def without_a_configuration_there_is_the_prompt_and_nothing_is_sent():
    chip = _Chip()
    _configure()
    os.remove("config.json")
    service.this_board = _Draw
    service.print = lambda *words: lines.append(" ".join(map(str, words)))
    service.run()
    assert lines[-1] == "there is no configuration"
    assert network.state.asked is None
    assert chip.receiver.hellos == []


def for_3_s_after_a_reset_there_is_no_watchdog_and_then_it_serves():
    chip = _Chip()
    _configure()
    chip.at(3 * SECOND - 1000, lambda: _none_yet(chip))
    chip.at(11 * SECOND, _enough)
    try:
        _run(_Draw())
    except _Enough:
        times = [s["time_us"] for s in chip.receiver.samples]
        assert 0 <= chip.receiver.hellos[0][2] <= times[0] <= times[-1] <= 8 * SECOND, times[-1]
        assert len(times) > 150
        return
    raise AssertionError("it ended")


def _none_yet(chip):
    assert network.state.asked is None
    assert chip.receiver.hellos == []


def the_radio_never_sleeps_and_its_own_network_is_off():
    for board in (Esp8266(), Esp32C3()):
        network.state.__init__()
        esp.State.sleep = esp.SLEEP_MODEM
        board.open_wlan()
        assert network.state.active == {network.AP_IF: False, network.STA_IF: True}
        told = (esp.State.sleep, network.state.pm, network.state.reconnects)
        assert told in ((esp.SLEEP_NONE, None, None), (esp.SLEEP_MODEM, network.WLAN.PM_NONE, 0))


def a_sensor_cut_off_in_a_byte_is_clocked_free():
    for held, pulses in ((0, 0), (5, 5), (99, 9)):
        machine.state.__init__()
        machine.state.pulses_until_free = held
        Esp8266().open_bus()
        assert machine.state.pulses == pulses, held
        assert machine.state.pins == (5, 4)
    Esp32C3().open_bus()
    assert machine.state.pins == (7, 6)


def the_cause_of_the_reset_is_told():
    for cause, told in ((0, 1), (6, 2), (1, 3), (3, 3), (5, 4), (4, 5), (2, 0)):
        machine.state.cause = cause
        assert Esp8266().reset_cause() == told


def the_battery_is_half_of_what_fills_the_range():
    for board in (Esp8266(), Esp32C3()):
        assert board.open_battery(4500)() == 2250
        assert board.open_battery(0)() == 0


def the_watchdog_takes_a_time_only_where_it_can():
    machine.state.clock = FakeClock()
    Esp8266().open_watchdog()
    assert machine.state.watchdog_timeout is None
    Esp32C3().open_watchdog()
    assert machine.state.watchdog_timeout == 3000
