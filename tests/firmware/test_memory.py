"""What a running unit takes of the heap, in MicroPython, with sensors and a network that take nothing."""

from tests.firmware.harness import Run

SCRIPT = """
import gc, time, unit
from clock import Clock
from fake_receiver import Draw, FakeReceiver
from link import Link
from sensors import Bus, Imu, RangeFinder

class Time:
    us = 0
    ticks_add, ticks_diff = time.ticks_add, time.ticks_diff
    def ticks_us(self): return self.us

class Sensor:
    stream = status = mm = sigma = signal = ambient = spads = waiting = lost = scale_code = 0
    budget_us, period_us, rate_hz = 15000, 20000, 416
    def begin(self): pass
    def ready(self): return source.us % 20_000 == 0
    def read(self): self.stream = (self.stream + 1) % 256
    def drain(self, buffer, most): return 8
    def temperature_cdeg(self): return 2500

class Port(FakeReceiver):
    sent = 0
    def send(self, datagram): self.sent += 1

class Collector:
    def collect(self): pass

unit.gc = Collector()
source, bus = Time(), Bus()
clock = Clock(source)
receiver = FakeReceiver(7, bytes(32))
link = Link(7, bytes(32), receiver, clock, Draw(), 1, 1)
sensor = Sensor()
u = unit.Unit(7, link, RangeFinder(sensor, clock, bus), Imu(sensor, clock, bus), bus, clock, lambda: 3900)
u.step()
receiver.open()
sent = 0
def send(datagram):
    global sent
    sent += 1
receiver.send = send

def go(passes):
    for _ in range(passes):
        source.us += 1000
        u.step()

go(100)
before, first = gc.mem_alloc(), sent
go(1000)
print((gc.mem_alloc() - before) // (sent - first), sent - first)
u._last = clock.add(clock.ticks(), 10_000_000)
before = gc.mem_alloc()
go(500)
print((gc.mem_alloc() - before) // 500)
"""


def test_a_sample_takes_less_than_1_kb_of_the_heap_and_a_pass_without_one_takes_none(micropython: Run) -> None:
    per_sample, per_pass = micropython({}, SCRIPT)
    a_sample, samples = map(int, per_sample.split())
    assert samples == 50
    assert a_sample < 1000
    assert int(per_pass) == 0
