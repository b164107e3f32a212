"""A whole unit on fakes: clock, bus, both sensors, receiver; `run(us)` lets its loop go on, a pass each ms or so."""

from clock import Clock
from fake_bus import Bus as FakeBus
from fake_bus import Clock as FakeClock
from fake_lsm6ds3 import FakeLsm6ds3
from fake_receiver import Draw, FakeReceiver
from fake_vl53l1x import FakeVl53l1x
from fake_vl53l5cx import FakeVl53l5cx
from link import Link
from lsm6ds3 import LSM6DS3
from sensors import Bus, Imu, RangeFinder, Touch
from unit import Unit
from vl53l1x import VL53L1X
from vl53l5cx import VL53L5CX

KEY = bytes(range(32))
CONFIG = {
    "unit": 7, "key": "00112233445566778899aabbccddeeff" * 2, "ssid": "net", "password": "correct horse",
    "host": "10.0.0.1", "port": 4950, "battery_full_mv": 0, "sensor": "vl53l1x", "zones": 1, "touch_ohm": 0,
    "touch_least_mn": 500, "touch_mn_per_us": 10,
}  # fmt: skip


class FakeUnit:
    def __init__(self, start_us=0, touch=None, zones=1, now=None, receiver=None):
        """`touch` is the device of its touch sensor, if it has one; `zones` are along a side of its range finder.

        `now` and `receiver` are a clock and a port in place of the fakes.
        """
        self.now = now or FakeClock(start_us)
        self.range_finder, self.lsm6ds3 = (FakeVl53l1x if zones == 1 else FakeVl53l5cx)(self.now), FakeLsm6ds3(self.now)
        self.bus = FakeBus(self.now, self.range_finder, self.lsm6ds3)
        self.receiver = receiver or FakeReceiver(7, KEY)
        self.battery_mv = 3900
        self.errors = Bus()
        clock = Clock(self.now)
        device = VL53L1X(self.bus, self.now) if zones == 1 else VL53L5CX(self.bus, zones, time=self.now)
        self.unit = Unit(
            7,
            Link(7, KEY, self.receiver, clock, Draw(), 1, 1),
            RangeFinder(device, clock, self.errors),
            Imu(LSM6DS3(self.bus, self.now), clock, self.errors),
            self.errors,
            clock,
            lambda: self.battery_mv,
            None if touch is None else Touch(touch, clock),
        )
        self._next_beacon = 0

    def run(self, us, each=None, pass_us=1_000):
        """Let the loop go on for so long, with beacons; return the samples that came."""
        before = len(self.receiver.samples)
        until = self.now.now_us + us
        while self.now.now_us < until:
            if self.now.now_us >= self._next_beacon and self.receiver.hellos:
                self._next_beacon = self.now.now_us + 500_000
                (self.receiver.go_on if self.receiver.session else self.receiver.open)()
            self.unit.step()
            self.now.advance(pass_us)
            if each:
                each()
        return self.receiver.samples[before:]
