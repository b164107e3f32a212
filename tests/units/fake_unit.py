"""A sensor unit's side of the wire in a few lines, and a wire without delays to a receiver's real socket."""

import socket
from dataclasses import astuple, replace
from typing import NamedTuple

from pretouch.sensing.unit import NetworkUnits
from pretouch.types import FloatArray
from pretouch.units.keys import Keys, UnitKey
from pretouch.units.receiver import SkinReceiver
from pretouch.units.unit import imu_batch
from pretouch.units.wire import Beacon, Flag, Hello, Mac, Sample, decode_beacon, session_mac

KEYS = Keys(UnitKey(f"unit {n}", n, bytes([n]) * 32) for n in (3, 4, 5))
IDS = ("unit 3", "unit 4")
"""Of the skin; the key of unit 5 is known, but it is not part of it."""
PLAIN = Sample(
    unit=3, flags=Flag.RANGE_NEW, sequence=1, time_us=0, beacon=1, beacon_hold_us=0, battery_mv=3900,
    temperature_cdeg=2500, bus_errors=0, range_stream=1, range_status=0, range_mm=500, range_age_us=10_000,
    range_sigma=8, range_signal=300, range_ambient=5, range_spads=4000, imu_count=2, imu_scale=0x10, imu_rate_hz=500,
    imu_index=0, imu_age_us=1000, imu=bytes(24),
)  # fmt: skip


class ImuBatch(NamedTuple):
    """IMU samples of one datagram."""

    unit: int
    index: int
    stamp: FloatArray
    acceleration: FloatArray
    angular_velocity: FloatArray


def imu_taken(receiver: SkinReceiver) -> list[ImuBatch]:
    """IMU samples since the last call."""
    heard = [(one, imu_batch(one)) for one in receiver.take_samples()]
    return [ImuBatch(one.unit, one.sample.imu_index, *astuple(batch)) for one, batch in heard if batch]


class FakeUnit:
    """Does what the firmware does, when it is told to. Its clock shows `now` - `offset`."""

    def __init__(self, key: UnitKey, offset: float = 0.0) -> None:
        self.key, self.mac, self.offset, self.boots = key, Mac(key.key), offset, 0
        self.reboot(offset)

    def reboot(self, now: float) -> None:
        self.boots += 1
        self.offset, self.challenges = now, 0
        self.leave()

    def leave(self) -> None:
        self.challenges += 1
        self.challenge = bytes([self.key.number, self.boots, self.challenges]).ljust(8, b"\0")
        self.session: Mac | None = None
        self.beacon: Beacon | None = None
        self.sequence, self.heard_us = 0, 0

    def us(self, now: float) -> int:
        return round(1e6 * (now - self.offset))

    def hello(self, now: float) -> bytes:
        return Hello(self.key.number, 0x0102, 1, self.challenge, self.us(now)).encode(self.mac)

    def hear(self, datagram: bytes, now: float) -> bool:
        beacon = decode_beacon(datagram, self.mac, self.challenge)
        if beacon is None or beacon.unit != self.key.number:
            return False
        if self.beacon is not None and (beacon.nonce != self.beacon.nonce or beacon.number <= self.beacon.number):
            return False
        self.beacon, self.heard_us = beacon, self.us(now)
        self.session = self.session or session_mac(self.mac, self.challenge, beacon.nonce)
        return True

    def sample(self, now: float, **changes: object) -> bytes:
        self.sequence += 1
        made = replace(
            PLAIN, unit=self.key.number, sequence=self.sequence, time_us=self.us(now), beacon=self.beacon.number,
            beacon_hold_us=self.us(now) - self.heard_us, range_stream=self.sequence % 256,
            range_mm=500 + self.sequence % 7,
        )  # fmt: skip
        return replace(made, **changes).encode(self.session)


class Bench:
    """A receiver under a clock that is set by hand, and a socket that stands for all units."""

    def __init__(self, start: float = 100.0, drawn: int = 0, units: NetworkUnits | tuple[str, ...] = IDS) -> None:
        self.now = start
        self._drawn = drawn
        self.receiver = SkinReceiver(units, KEYS, clock=lambda: self.now, draw=self._draw)
        self.socket = self.new_socket()
        self.units = [FakeUnit(KEYS[id], start - 50.0 - 7.0 * k) for k, id in enumerate(IDS)]

    def new_socket(self) -> socket.socket:
        made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        made.bind(("127.0.0.1", 0))
        made.setblocking(False)
        return made

    def _draw(self, size: int) -> bytes:
        self._drawn += 1
        return self._drawn.to_bytes(size, "little")

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()
        self.receiver.close()

    def send(self, *datagrams: bytes, by: socket.socket | None = None) -> int:
        """Send, and let the receiver take in: return how many samples it accepted."""
        for datagram in datagrams:
            (by or self.socket).sendto(datagram, self.receiver.address)
        return self.receiver.receive()

    def wait(self, seconds: float) -> None:
        """Let time go by in which no unit says anything."""
        self.now += seconds
        self.receiver.receive()

    def answers(self, by: socket.socket | None = None) -> list[bytes]:
        """Return what came back."""
        came = []
        while True:
            try:
                came.append((by or self.socket).recv(2048))
            except BlockingIOError:
                return came

    def deliver(self) -> list[bytes]:
        """Let the units hear what came back; return it."""
        came = self.answers()
        for datagram in came:
            for unit in self.units:
                unit.hear(datagram, self.now)
        return came

    def greet(self, *units: FakeUnit) -> None:
        """Let units ask for a session, and hear what came back."""
        self.send(*[unit.hello(self.now) for unit in units])
        self.deliver()

    def join(self) -> None:
        """Bring all units into session."""
        self.greet(*self.units)
        for unit in self.units:
            assert self.send(unit.sample(self.now)) == 1

    def run(self, seconds: float) -> int:
        """Let time go by with a sample of each unit every 20 ms; return how many were accepted."""
        accepted = 0
        for _ in range(round(seconds / 0.02)):
            self.now += 0.02
            accepted += self.send(*[unit.sample(self.now) for unit in self.units])
            self.deliver()
        return accepted
