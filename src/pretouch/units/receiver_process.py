"""The process in which a skin's receiver runs, and what it leaves in shared memory for the program that started it."""

import gc
import os
import pickle
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from signal import SIGINT

from pretouch.errors import HardwareError
from pretouch.sensing.unit import NetworkUnits
from pretouch.signals import leave_to_parent
from pretouch.units.keys import Keys, UnitKey
from pretouch.units.link import LinkParams
from pretouch.units.receiver import SkinReceiver
from pretouch.units.shared_memory import Mailbox, Ring
from pretouch.units.traffic import Received, UnitTraffic
from pretouch.units.wire import SAMPLE_MOST, TAG_SIZE, sample_of

_PAUSE_S = 0.008
"""Pause after each look at the socket [s]: what arrives meanwhile is taken in at once. Waking up for each sample would
cost three times the processor time."""
_MANY, _SHORT_PAUSE_S = 64, 0.001
"""Datagrams in one look that are a flood, which must not pile up, and the pause then [s]."""
_TRAFFIC_PERIOD_S = 0.5
"""Time between two accounts of the traffic [s]."""
_WAIT_S = 0.05
"""Longest wait for a datagram [s]."""

_RECORD = struct.Struct("<Hdddd")
"""Index of the unit; arrival, stamp, offset, bound; then the datagram without its tag."""


@dataclass(frozen=True)
class Traffic:
    """All that a receiver has counted."""

    units: tuple[UnitTraffic, ...]
    rejected: dict[str, int]
    """Datagrams thrown away, by reason (`traffic.REASONS`)."""
    unsent: int
    """Beacons the system did not take."""


class SharedOutputs:
    """Where a receiver puts what it has; as an argument of a process that is being spawned it is the same there."""

    def __init__(self, units: NetworkUnits | Sequence[str], samples_most: int) -> None:
        self.network = NetworkUnits.of(units)
        """Whose they are."""
        self._readings = Mailbox(24 * self.network.rows)
        self._touch = Mailbox(32 * self.network.rows)
        self._traffic = Mailbox(4096 + sum(2560 + len(id.encode()) for id in self.network.ids))
        self._samples = Ring(samples_most, _RECORD.size + SAMPLE_MOST - TAG_SIZE)

    def put_readings(self, table: bytes) -> None:
        """Give stamps, distances and statuses, (3, K) float64."""
        self._readings.write(table)

    def put_touch(self, table: bytes) -> None:
        """Give stamps, contacts, forces and statuses of touch, (4, K) float64."""
        self._touch.write(table)

    def touch(self) -> bytes | None:
        """Return the newest stamps, contacts, forces and statuses of touch, (4, K) float64; None before the first."""
        number, value = self._touch.read()
        return value if number else None

    def put_samples(self, records: list[bytes]) -> None:
        """Give samples, as `packed` made them."""
        for record in records:
            self._samples.write(record)

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

    def traffic(self) -> Traffic | None:
        """Return the newest counts; None before the first."""
        number, value = self._traffic.read()
        return pickle.loads(value) if number else None  # noqa: S301  our own process wrote it


def packed(received: Received, datagram: memoryview) -> bytes:
    """Return a sample for the program that started the receiver: what the unit said is taken apart there."""
    return (
        _RECORD.pack(received.unit, received.arrival, received.stamp, received.offset, received.bound)
        + datagram[:-TAG_SIZE]
    )


def _unpack(record: bytes) -> Received:
    index, arrival, stamp, offset, bound = _RECORD.unpack_from(record)
    sample = sample_of(record[_RECORD.size :])
    if sample is None:
        raise RuntimeError("the length of a stored sample differs from its header")
    return Received(index, arrival, stamp, offset, bound, sample)


def _set_priority(priority: int | None) -> None:
    if priority is None:
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except (AttributeError, OSError) as error:
        raise HardwareError(
            f"The receiver's process could not get the real-time priority {priority} ({error}): raise the limit"
            " `rtprio` (docs/how-to/realtime.md), or run without a priority."
        ) from None


class ReceiverService:
    """A receiver whose readings and samples go to outlets."""

    def __init__(
        self, units: tuple[UnitKey, ...], address: tuple[str, int], params: LinkParams, outputs: SharedOutputs
    ) -> None:
        """Listen; see `SkinReceiver`."""
        self._records: list[bytes] = []
        self.receiver = SkinReceiver(outputs.network, Keys(units), *address, params=params, deliver=self._keep)
        self._outputs = outputs

    def step(self) -> None:
        """Wait for datagrams if none are there, and give away what they brought."""
        if not self.receiver.receive(_WAIT_S):
            return
        self._outputs.put_readings(self.receiver.table.tobytes())
        self._outputs.put_touch(self.receiver.touch_table.tobytes())
        self._outputs.put_samples(self._records)
        self._records.clear()

    def _keep(self, received: Received, datagram: memoryview) -> None:
        self._records.append(packed(received, datagram))


def serve(
    parent: int,
    units: tuple[UnitKey, ...],
    address: tuple[str, int],
    params: LinkParams,
    priority: int | None,
    outputs: SharedOutputs,
    started: Connection,
) -> None:
    """Receive until the parent is gone, or kills this process; tell it the address, or as a sentence what is wrong."""
    leave_to_parent({SIGINT})
    try:
        _set_priority(priority)
        service = ReceiverService(units, address, params, outputs)
    except HardwareError as error:
        started.send(str(error))
        return
    gc.collect()
    gc.freeze()
    receiver = service.receiver
    with receiver:
        started.send((receiver.address, receiver.buffer_bytes))
        started.close()
        report_at = -1.0
        while True:
            service.step()
            now = time.monotonic()
            if now >= report_at:
                report_at = now + _TRAFFIC_PERIOD_S
                outputs.put_traffic(Traffic(receiver.units, receiver.rejected, receiver.unsent))
                if os.getppid() != parent:
                    return
            if not receiver.behind:
                time.sleep(_SHORT_PAUSE_S if receiver.taken > _MANY else _PAUSE_S)
