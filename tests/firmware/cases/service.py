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
from fake_bus import error_of
from fake_lsm6ds3 import FakeLsm6ds3
from fake_receiver import Draw, FakeReceiver
from fake_unit import CONFIG
from fake_vl53l1x import FakeVl53l1x
from lsm6ds3 import LSM6DS3
from vl53l1x import VL53L1X

os.chdir(sys.path[0])
SECOND = 1_000_000
lines = []
"""What the unit printed."""
service.print = lambda *words: lines.append(" ".join(map(str, words)))


class _Enough(BaseException):
    """The test has seen enough of an endless loop."""


def _enough():
    raise _Enough("seen")


class _Draw(Esp8266):
    """An ESP8266; not every interpreter that tests run in has `os.urandom`."""

    draw = Draw()


class _Time(FakeClock):
    """The module `time` of a chip: sleeping lets time pass, `events` happen, and the watchdog look."""

    def __init__(self):
        super().__init__()
        self.events = []

    def sleep_ms(self, ms):
        super().sleep_ms(ms)
        machine.state.check_watchdog()
        while self.events and self.events[0][0] <= self.now_us:
            self.events.pop(0)[1]()


class _Chip:
    """Everything a unit finds on its board, in a network with its receiver, and its configuration."""

    def __init__(self):
        machine.state.__init__()
        network.state.__init__()
        time = self.time = service.time = machine.state.clock = _Time()
        self.vl53l1x, self.lsm6ds3 = FakeVl53l1x(time), FakeLsm6ds3(time)
        self.bus = machine.state.bus = FakeBus(time, self.vl53l1x, self.lsm6ds3)
        self.receiver = socket.state.receiver = FakeReceiver(7, Config(CONFIG).key)
        service.VL53L1X = lambda i2c: VL53L1X(i2c, time)
        service.LSM6DS3 = lambda i2c: LSM6DS3(i2c, time)
        self._beacon(SECOND // 2)
        with open("config.json", "w") as file:
            file.write(json.dumps(CONFIG))

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
        error_of(service.serve, _Draw(), Clock(self.time), Config(CONFIG), kind=_Enough)
        return self.receiver.samples

    def run(self, board, kind):
        """Run it as after a reset, until that happens."""
        service.this_board = lambda: board
        return error_of(service.run, kind=kind)

    def is_silent(self):
        assert network.state.asked == []
        assert self.receiver.hellos == []


def a_touch_sensor_is_looked_at_on_a_board_that_has_a_pin_for_it():
    machine.state.__init__()
    clock, config = Clock(FakeClock()), Config(dict(CONFIG, touch_ohm=3300))
    touch = service.touch_of(Esp32C3(), clock, config)
    touch.step(clock.ticks())
    assert touch.new, "1250 mV at the pin"
    assert service.touch_of(Esp32C3(), clock, Config(CONFIG)) is None
    assert service.touch_of(Esp8266(), clock, config) is None
    assert Esp8266().noted() == "this board has no pin for a touch sensor"


def a_network_lost_and_back_is_no_end():
    chip = _Chip()
    chip.at(3 * SECOND, lambda: setattr(network.state, "there", False))
    chip.at(9 * SECOND, lambda: setattr(network.state, "there", True))
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

    chip.at(2 * SECOND, lambda: setattr(chip.bus, "readfrom_mem_into", hang))
    assert error_of(chip.serve, 10 * SECOND, kind=machine.Reset) == "watchdog"
    assert 5 * SECOND <= chip.time.now_us < 5.3 * SECOND


def an_error_nobody_expected_is_noted_without_secrets_and_the_unit_begins_anew():
    board = _Draw()

    def fail():
        raise MemoryError("of no use")

    board.open_wlan = fail
    assert _Chip().run(board, machine.Reset) == "machine.reset"
    for words, there in (("MemoryError", True), ("of no use", True), (CONFIG["key"], False), ("correct horse", False)):
        assert (words in board.noted()) is there, board.noted()


def a_note_may_be_any_bytes():
    board = Esp8266()
    machine.state.memory = b"\xff\xfe"
    assert board.noted() == ""
    board.note("x" * 1000 + "end")
    assert board.noted() == "x" * 197 + "end"


def without_a_configuration_there_is_the_prompt_and_nothing_is_sent():
    chip = _Chip()
    os.remove("config.json")
    service.this_board = _Draw
    service.run()
    assert lines[-1] == "there is no configuration"
    chip.is_silent()


def for_3_s_after_a_reset_there_is_no_watchdog_and_then_it_joins_and_says_50_samples_a_second():
    chip = _Chip()
    chip.at(3 * SECOND - 1000, chip.is_silent)
    chip.at(8 * SECOND, _enough)
    chip.run(_Draw(), _Enough)
    samples = chip.receiver.samples
    times = [s["time_us"] for s in samples]
    assert 0 <= chip.receiver.hellos[0][2] <= times[0] <= times[-1] <= 5 * SECOND, times[-1]
    assert [each[1:] for each in network.state.asked] == [("net", "correct horse")]
    assert socket.state.sent_to == (("10.0.0.1", 4950),)
    assert 200 <= len(samples) <= 250
    assert sum(s["flags"] & 1 for s in samples) > 190
    assert machine.state.hz == 160_000_000


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
    for board, timeout in ((Esp8266(), None), (Esp32C3(), 3000)):
        board.open_watchdog()
        assert machine.state.watchdog_timeout == timeout
