"""What the receiver of sensor units costs, and how it stands a flood.

Forty units send 50 samples a second each, with nine IMU samples in each, over loopback to a `NetworkSkin`. Counted are
the CPU time of its process (Linux tells it), the share of samples that are lost, and how late they are taken in. Then
the same under 100 000 datagrams a second of garbage: of random bytes, with a right beginning and a wrong tag, and one
genuine datagram again and again, alone and mixed.

    python -m tests.units.flood
    python -m tests.units.flood 30 7 10    # seconds each, 10 by default; units, 40; priority, none
"""

import multiprocessing
import os
import secrets
import select
import socket
import sys
import time
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pretouch.units.keys import Keys, UnitKey, new_key
from pretouch.units.skin import NetworkSkin
from pretouch.units.wire import Mac
from tests.units.fake_unit import PLAIN, FakeUnit

RATE, FLOOD = 50.0, 100_000.0
"""Samples a second of each unit; datagrams a second of a flood."""
LONGEST_BURST_S, LONGEST_START_S = 0.005, 30.0
"""A sender that had to wait makes up for no more; in so long all units must be heard, and processes end."""
KINDS = (None, "random", "forged", "replayed", "mixed")
IMU = {"imu_count": 9, "imu_rate_hz": 450, "imu": secrets.token_bytes(9 * 12)}


def send_samples(keys: Keys, address: tuple[str, int], stop) -> None:
    """Be all units until `stop` is set, their turns spread over the period. Their clock is the host's."""
    units, poll = {}, select.poll()
    for key in keys.values():
        wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        wire.connect(address)
        poll.register(wire, select.POLLIN)
        units[wire.fileno()] = FakeUnit(key), wire
    step, due = 1.0 / (RATE * len(units)), time.monotonic()
    for unit, wire in cycle(units.values()):
        while True:
            left = due - time.monotonic()
            for handle, _ in poll.poll(max(1e3 * left, 0.0)):
                hearing, beacons = units[handle]
                hearing.hear(beacons.recv(2048), time.monotonic())
            if left <= 0:
                break
        now = time.monotonic()
        wire.send(unit.sample(now, imu_index=9 * unit.sequence, **IMU) if unit.session else unit.hello(now))
        due += step + max(-left - LONGEST_BURST_S, 0.0)
        if stop.is_set():
            return


def garbage(kind: str, keys: Keys) -> list[bytes]:
    """Make datagrams of a flood."""
    rng, session = np.random.default_rng(0), Mac(new_key())
    random = [rng.bytes(int(size)) for size in rng.integers(1, 400, 1000)]
    units = [int(unit) for unit in rng.choice(list(keys.by_number), 1000)]
    forged = [replace(PLAIN, unit=u, sequence=1_000_000 + k, **IMU).encode(session) for k, u in enumerate(units)]
    replayed = [replace(PLAIN, unit=units[0], sequence=1, **IMU).encode(session)]
    kinds = {"random": random, "forged": forged, "replayed": replayed}
    return kinds[kind] if kind in kinds else [d for three in zip(random, forged, cycle(replayed)) for d in three]


def flood(kind: str, rate: float, keys: Keys, address: tuple[str, int], stop, sent) -> None:
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


class Outcome(NamedTuple):
    """Of one run: share of a core, samples, share of them that is lost, how late each was taken in [s], flood [1/s]."""

    cpu: float
    accepted: int
    lost: float
    lateness: np.ndarray
    flooded: float


def measure(duration: float, count: int, kind: str | None, priority: int | None, rate: float = FLOOD) -> Outcome | None:
    """Let so many units send for so long [s], and flood the receiver with garbage of that kind, at that rate [1/s].

    None if not all units were heard within `LONGEST_START_S`.
    """
    keys = Keys(UnitKey(f"unit {k + 1}", k + 1, new_key()) for k in range(count))
    context = multiprocessing.get_context("spawn")
    stop, sent = context.Event(), context.Value("q", 0)
    with NetworkSkin(tuple(keys), keys) as skin:
        if priority is not None:
            os.sched_setscheduler(skin.pid, os.SCHED_FIFO, os.sched_param(priority))
        asked = [(send_samples, (keys, skin.address, stop))]
        asked += [(flood, (kind, rate, keys, skin.address, stop, sent))] if kind else []
        others = [context.Process(target=target, args=args, daemon=True) for target, args in asked]
        for process in others:
            process.start()
        try:
            until = time.monotonic() + LONGEST_START_S
            while any(unit.state != "live" for unit in skin.traffic().units) or (kind and not sent.value):
                if time.monotonic() > until:
                    return None
                time.sleep(0.05)
            return _watch(skin, sent, duration)
        finally:
            stop.set()
            for process in others:
                process.join(LONGEST_START_S)
                process.kill()


def _watch(skin: NetworkSkin, sent, duration: float) -> Outcome:
    def cpu_s() -> float:
        return int(Path(f"/proc/{skin.pid}/schedstat").read_text().split()[0]) * 1e-9

    time.sleep(1.0)
    skin.take_samples()
    before, flooded, begin, received = cpu_s(), sent.value, time.monotonic(), []
    while time.monotonic() < begin + duration:
        time.sleep(0.1)
        received += skin.take_samples()
    took = time.monotonic() - begin
    cpu, flooded = (cpu_s() - before) / took, (sent.value - flooded) / took
    # between the first and the last of each unit
    unit, sequence = np.array([(one.unit, one.sample.sequence) for one in received]).T
    every = sum(np.ptp(sequence[unit == k]) + 1 for k in np.unique(unit))
    lateness = np.array([one.arrival - 1e-6 * one.sample.time_us for one in received])
    return Outcome(cpu, len(received), 1.0 - len(received) / every, lateness, flooded)


def main(duration: float = 10.0, count: int = 40, priority: int | None = None) -> None:
    """Measure, print."""
    print("flood [1/s], share of a core [%], lost [%] of samples, late by [ms] (50 %, 99 %, most)")
    for kind in KINDS:
        run = measure(duration, count, kind, priority)
        if run is None:
            print(f"{kind}: not all units were heard within {LONGEST_START_S:g} s", flush=True)
            continue
        late = ", ".join(f"{1e3 * s:.2f}" for s in np.percentile(run.lateness, (50, 99, 100)))
        lost = f"{100 * run.lost:.3f} of {run.accepted}"
        print(f"{kind}: {run.flooded:.0f}, {100 * run.cpu:.1f}, {lost}, {late}", flush=True)


if __name__ == "__main__":
    main(*(of(word) for of, word in zip((float, int, int), sys.argv[1:], strict=False)))
