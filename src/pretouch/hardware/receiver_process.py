"""The process in which a skin's receiver runs, and what it leaves in shared memory for the program that started it."""

import gc
import os
import pickle
import signal
import struct
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from operator import attrgetter

from pretouch.errors import HardwareError
from pretouch.hardware.keys import Keys, UnitKey
from pretouch.hardware.link import LinkParams
from pretouch.hardware.mailbox import Mailbox
from pretouch.hardware.receiver import SkinReceiver
from pretouch.hardware.ring import Ring
from pretouch.hardware.traffic import Received, UnitTraffic
from pretouch.hardware.wire import SAMPLE, SAMPLE_MOST, Sample

_PAUSE_S = 0.008
"""Pause after each look at the socket [s]: what arrives meanwhile is taken in at once. Waking up for each sample would
cost three times the processor time."""
_MANY, _SHORT_PAUSE_S = 64, 0.001
"""Datagrams in one look that are a flood, which must not pile up, and the pause then [s]."""
_TELL_S = 0.5
"""Time between two accounts of the traffic [s]."""
_WAIT_S = 0.05
"""Longest wait for a datagram [s]."""

_RECORD = struct.Struct("<HHdddd")
"""Index and number of the unit; arrival, stamp, offset, bound; then the sample as in `SAMPLE`, and its IMU data."""
_RECORD_MOST = _RECORD.size + SAMPLE_MOST
_FIELDS = attrgetter(*[name for name in Sample.__slots__ if name not in ("unit", "imu")])


@dataclass(frozen=True)
class Traffic:
    """All that a receiver has counted."""

    units: tuple[UnitTraffic, ...]
    rejected: dict[str, int]
    """Datagrams thrown away, by reason (`traffic.REASONS`)."""
    unsent: int
    """Beacons the system did not take."""


class Outlets:
    """Where a receiver puts what it has; as an argument of a process that is being spawned it is the same there."""

    def __init__(self, ids: tuple[str, ...], samples_most: int) -> None:
        self._readings = Mailbox(24 * len(ids))
        self._traffic = Mailbox(4096 + sum(2048 + len(id.encode()) for id in ids))
        self._samples = Ring(samples_most, _RECORD_MOST)

    def put_readings(self, table: bytes) -> None:
        """Give stamps, distances and statuses, (3, K) float64."""
        self._readings.write(table)

    def put_samples(self, samples: list[Received]) -> None:
        """Give samples."""
        for sample in samples:
            self._samples.write(_pack(sample))

    def put_traffic(self, traffic: Traffic) -> None:
        """Give what was counted."""
        self._traffic.write(pickle.dumps(traffic))

    def readings(self) -> bytes | None:
        """Return the newest stamps, distances and statuses, (3, K) float64; None before the first."""
        number, value = self._readings.read()
        return value if number else None

    def take_samples(self) -> list[Received]:
        """Return the samples that came since the last call."""
        return [_unpack(record) for record in self._samples.take()]

    @property
    def lost(self) -> int:
        """Samples that were taken too late."""
        return self._samples.lost

    def traffic(self) -> Traffic | None:
        """Return the newest counts; None before the first."""
        number, value = self._traffic.read()
        return pickle.loads(value) if number else None  # noqa: S301  our own process wrote it


def _pack(received: Received) -> bytes:
    sample = received.sample
    head = _RECORD.pack(received.unit, sample.unit, received.arrival, received.stamp, received.offset, received.bound)
    return head + SAMPLE.pack(*_FIELDS(sample)) + sample.imu


def _unpack(record: bytes) -> Received:
    index, number, arrival, stamp, offset, bound = _RECORD.unpack_from(record)
    fields = *SAMPLE.unpack_from(record, _RECORD.size), record[_RECORD.size + SAMPLE.size :]
    return Received(index, arrival, stamp, offset, bound, Sample(number, *fields))


def _go_first(priority: int | None) -> None:
    if priority is None:
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError) as error:
        raise HardwareError(
            f"The receiver's process cannot have the real-time priority {priority} ({error}):"
            " raise the limit `rtprio` (docs/realtime.md), or leave the priority out."
        ) from None


def serve(
    parent: int,
    units: tuple[UnitKey, ...],
    address: tuple[str, int],
    params: LinkParams,
    priority: int | None,
    outlets: Outlets,
    started: Connection,
) -> None:
    """Receive until the parent is gone, or kills this process; tell it the address, or as a sentence what is wrong."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    try:
        _go_first(priority)
        receiver = SkinReceiver([unit.id for unit in units], Keys(units), *address, params=params)
    except HardwareError as error:
        started.send(str(error))
        return
    gc.collect()
    gc.freeze()
    with receiver:
        started.send((receiver.address, receiver.buffer_bytes, receiver.filtered))
        started.close()
        tell_at = -1.0
        while True:
            if receiver.receive(_WAIT_S):
                outlets.put_readings(receiver.table.tobytes())
                outlets.put_samples(receiver.take_samples())
            now = time.monotonic()
            if now >= tell_at:
                tell_at = now + _TELL_S
                outlets.put_traffic(Traffic(receiver.units, receiver.rejected, receiver.unsent))
                if os.getppid() != parent:
                    return
            if not receiver.behind:
                time.sleep(_SHORT_PAUSE_S if receiver.taken > _MANY else _PAUSE_S)
