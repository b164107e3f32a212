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


class FakeUnit:
    def __init__(self, start_us=0, touch=None, zones=1, now=None, receiver=None):
        """`touch` is the device of its touch sensor, if it has one; `zones` are along a side of its range finder.

        `now` and `receiver` are a clock and a port in place of the fakes.
        """
        self.now = now or FakeClock(start_us)
        self.bus = FakeBus(self.now)
        self.vl53l1x, self.lsm6ds3 = FakeVl53l1x(self.now), FakeLsm6ds3(self.now)
        self.vl53l5cx = FakeVl53l5cx(self.now)
        self.bus.add(self.vl53l1x if zones == 1 else self.vl53l5cx)
        self.bus.add(self.lsm6ds3)
        self.receiver = receiver or FakeReceiver(7, KEY)
        self.battery_mv = 3900
        self.errors = Bus()
        clock = Clock(self.now)
        sleep_ms = self.now.sleep_ms
        device = VL53L1X(self.bus, 0x29, sleep_ms)
        if zones > 1:
            device = VL53L5CX(self.bus, zones, sleep_ms=sleep_ms)
        imu = LSM6DS3(self.bus, None, sleep_ms, self.now.ticks_us, self.now.ticks_diff)
        self.unit = Unit(
            7,
            Link(7, KEY, self.receiver, clock, Draw(), 1, 1),
            RangeFinder(device, clock, self.errors),
            Imu(imu, clock, self.errors),
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
