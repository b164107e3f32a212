"""What the receiver of sensor units costs, and how it stands a flood.

Forty units send 50 samples a second each, with nine IMU samples in each, over loopback to a `NetworkSkin`. Counted are
the CPU time of its process (Linux tells it), the share of samples that are lost, and how late they are taken in. Then
the same under 100 000 datagrams a second of garbage: of random bytes, with a right beginning and a wrong tag, and one
genuine datagram again and again, alone and mixed.

    python benchmarks/skin_receiver.py
    python benchmarks/skin_receiver.py 30 7 10    # seconds each, 10 unless given; units, 40; priority, none
"""

import multiprocessing
import os
import secrets
import select
import socket
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import numpy as np

from pretouch.units.keys import Keys, UnitKey, new_key
from pretouch.units.skin import NetworkSkin
from pretouch.units.wire import (
    CHALLENGE_SIZE,
    Beacon,
    Flag,
    Hello,
    Mac,
    Sample,
    decode_beacon,
    session_mac,
)

RATE, FLOOD = 50.0, 100_000.0
"""Samples a second of each unit; datagrams a second of a flood."""
LONGEST_BURST_S = 0.005
"""A sender that had to wait makes up for no more than this [s]."""
LONGEST_START_S = 30.0
"""In this time all units must be heard, and processes end [s]."""
IMU = secrets.token_bytes(9 * 12)
Address = tuple[str, int]
Stop = "multiprocessing.synchronize.Event"


class Unit:
    """One that measures at once and sends without fail. Its clock is the host's, so that lateness can be told."""

    def __init__(self, key: UnitKey, address: Address) -> None:
        self.number, self.mac, self.challenge = key.number, Mac(key.key), secrets.token_bytes(CHALLENGE_SIZE)
        self.session, self.sequence = None, 0
        self.heard: tuple[Beacon, int] | None = None
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(address)

    def listen(self) -> None:
        """Take in one beacon."""
        beacon = decode_beacon(self.socket.recv(2048), self.mac, self.challenge)
        if beacon is None:
            return
        self.heard = beacon, time.monotonic_ns() // 1000
        self.session = self.session or session_mac(self.mac, self.challenge, beacon.nonce)

    def speak(self) -> None:
        """Send a hello or a sample."""
        now = time.monotonic_ns() // 1000
        if self.session is None or self.heard is None:
            self.socket.send(Hello(self.number, 0x0100, 1, self.challenge, now).encode(self.mac))
            return
        self.sequence += 1
        beacon, since = self.heard
        sample = Sample(
            self.number, Flag.RANGE_NEW, self.sequence, now, beacon.number, now - since, 3900, 3000, 0,
            self.sequence % 256, 0, 500 + self.sequence % 9, 10_000, 8, 300, 5, 4000, 9, 0x10, 450,
            9 * self.sequence, 1000, IMU,
        )  # fmt: skip
        self.socket.send(sample.encode(self.session))


def send_samples(keys: Keys, address: Address, stop: Stop) -> None:
    """Be all units until told to stop; their turns are spread over the period."""
    units = [Unit(key, address) for key in keys.values()]
    by_handle = {unit.socket.fileno(): unit for unit in units}
    poll = select.poll()
    for handle in by_handle:
        poll.register(handle, select.POLLIN)
    step, due = 1.0 / (RATE * len(units)), time.monotonic()
    for unit in cycle(units):
        while True:
            left = due - time.monotonic()
            for handle, _ in poll.poll(max(1e3 * left, 0.0)):
                by_handle[handle].listen()
            if left <= 0:
                break
        unit.speak()
        due += step + max(-left - LONGEST_BURST_S, 0.0)
        if stop.is_set():
            return


def garbage(kind: str, keys: Keys) -> list[bytes]:
    """Make datagrams of a flood."""
    rng = np.random.default_rng(0)
    random = [rng.bytes(int(size)) for size in rng.integers(1, 400, 1000)]
    session = Mac(new_key())
    units = [rng.choice(list(keys.by_number)) for _ in range(1000)]
    forged = [
        Sample(*[int(unit), 1, 1_000_000 + k], *[0] * 14, 9, *[0] * 4, imu=IMU).encode(session)
        for k, unit in enumerate(units)
    ]
    replayed = [Sample(*[int(units[0]), 1, 1], *[0] * 14, 9, *[0] * 4, imu=IMU).encode(session)]
    kinds = {"random": random, "forged": forged, "replayed": replayed}
    return kinds[kind] if kind in kinds else [d for three in zip(random, forged, cycle(replayed)) for d in three]


def flood(kind: str, rate: float, keys: Keys, address: Address, stop: Stop, sent: "multiprocessing.Value") -> None:
    """Send garbage at that rate [1/s], as evenly as a loop can; what it could not send in time it leaves out."""
    datagrams, count = cycle(garbage(kind, keys)), 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.connect(address)
        last = time.monotonic()
        while not stop.is_set():
            now = time.monotonic()
            burst = int(min(now - last, LONGEST_BURST_S) * rate)
            for _ in range(burst):
                out.send(next(datagrams))
            count += burst
            last, sent.value = now, count
            time.sleep(0.0002)


@dataclass
class Outcome:
    """What was seen in one run."""

    cpu: float
    """Share of a core that the receiver's process used."""
    accepted: int
    lost: float
    """Share of the samples."""
    lateness: np.ndarray
    """Of each sample, from sending to being taken in [s]."""
    flooded: float
    """Datagrams of the flood a second."""


def on_cpu(pid: int) -> float:
    """CPU time a process has used [s]."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) * 1e-9


def measure(duration: float, keys: Keys, kind: str | None, priority: int | None, rate: float = FLOOD) -> Outcome | None:
    """Let all units send for so long [s], and flood the receiver with garbage of that kind, at that rate [1/s].

    None if not all units were heard within `LONGEST_START_S`.
    """
    context = multiprocessing.get_context("spawn")
    stop, sent = context.Event(), context.Value("q", 0)
    with NetworkSkin(tuple(keys), keys) as skin:
        if priority is not None:
            os.sched_setscheduler(skin.pid, os.SCHED_FIFO, os.sched_param(priority))
        others = [context.Process(target=send_samples, args=(keys, skin.address, stop), daemon=True)]
        if kind:
            others.append(context.Process(target=flood, args=(kind, rate, keys, skin.address, stop, sent), daemon=True))
        for process in others:
            process.start()
        try:
            return _watch(skin, sent, duration) if _all_heard(skin, kind is None, sent) else None
        finally:
            stop.set()
            for process in others:
                process.join(LONGEST_START_S)
                process.kill()


def _all_heard(skin: NetworkSkin, calm: bool, sent: "multiprocessing.Value") -> bool:
    """Wait for all units, and for the flood if there is one."""
    until = time.monotonic() + LONGEST_START_S
    while any(unit.state != "live" for unit in skin.traffic().units) or not (calm or sent.value):
        if time.monotonic() > until:
            return False
        time.sleep(0.05)
    return True


def _watch(skin: NetworkSkin, sent: "multiprocessing.Value", duration: float) -> Outcome:
    time.sleep(1.0)
    skin.take_samples()
    spent, flooded, begin, received = on_cpu(skin.pid), sent.value, time.monotonic(), []
    while time.monotonic() < begin + duration:
        time.sleep(0.1)
        received += skin.take_samples()
    took = time.monotonic() - begin
    cpu, flooded = (on_cpu(skin.pid) - spent) / took, (sent.value - flooded) / took
    return Outcome(cpu, len(received), _lost(received), _lateness(received), flooded)


def _lost(received: Sequence) -> float:
    """Share of the sequence numbers between the first and the last of each unit that are missing."""
    numbers: dict[int, list[int]] = {}
    for one in received:
        numbers.setdefault(one.unit, []).append(one.sample.sequence)
    sent = sum(max(n) - min(n) + 1 for n in numbers.values())
    return 1.0 - len(received) / sent


def _lateness(received: Sequence) -> np.ndarray:
    return np.array([one.arrival - 1e-6 * one.sample.time_us for one in received])


def main() -> None:
    """Measure, print."""
    duration = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 40
    priority = int(sys.argv[3]) if len(sys.argv) > 3 else None
    keys = Keys(UnitKey(f"unit {k + 1}", k + 1, new_key()) for k in range(count))
    print(f"{count} units, {RATE:g} samples a second each, {duration:g} s each;", end=" ")
    print(f"{os.cpu_count()} processors, load before of {os.getloadavg()[0]:.1f}", flush=True)
    for kind in (None, "random", "forged", "replayed", "mixed"):
        seen = measure(duration, keys, kind, priority)
        if seen is None:
            print(f"{kind or 'no flood':9s} not all units were heard within {LONGEST_START_S:g} s", flush=True)
            continue
        each = f", {1e6 * seen.cpu * duration / seen.accepted:.1f} us a sample" if kind is None else ""
        late = 1e3 * np.percentile(seen.lateness, (50, 99, 100))
        print(
            f"{kind or 'no flood':9s} {seen.flooded:7.0f}/s: {100 * seen.cpu:5.1f} % of a core{each};"
            f" {100 * seen.lost:.3f} % of {seen.accepted} lost;"
            f" late by {late[0]:.2f} ms (50 %), {late[1]:.2f} ms (99 %), {late[2]:.2f} ms (most)",
            flush=True,
        )


if __name__ == "__main__":
    main()
