"""The port `SkinPort` over the network: the receiver in a process of its own, the newest values in shared memory.

A flood, a slow disk or a garbage collection in one process does not stop the other. If the receiver's process dies,
readings grow old, which the controller names as silence. If the program that started it dies, it ends too, and the
memory between them has no name that could be left over.
"""

import gc
import os
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing import current_process, get_context
from multiprocessing.connection import Connection
from typing import Self

import numpy as np

from pretouch.errors import HardwareError
from pretouch.sensing.unit import NetworkUnits
from pretouch.signals import kept_from_children, leave_to_parent
from pretouch.types import FloatArray, RangeReadings, TouchReadings
from pretouch.units.keys import Keys, UnitKey
from pretouch.units.receiver import SAMPLES_MOST, SkinReceiver, demand_port, keys_of, range_readings, touch_readings
from pretouch.units.shared_memory import Mailbox, Ring
from pretouch.units.unit import NOTHING, Received, UnitTraffic
from pretouch.units.wire import SAMPLE_MOST, TAG_SIZE, sample_of

_START_S = 60.0
"""Longest time a process may take to start [s]: it imports everything anew."""
_PAUSE_S = 0.008
"""Pause after each look at the socket [s]: what arrives meanwhile is taken in at once. Waking up for each sample would
cost three times the processor time."""
_MANY, _SHORT_PAUSE_S = 64, 0.001
"""Datagrams in one look that are a flood, which must not pile up, and the pause then [s]."""
_TRAFFIC_PERIOD_S = 0.2
"""Time between two accounts of the traffic [s]."""
_WAIT_S = 0.05
"""Longest wait for a datagram [s]."""
_PICKLED = 1024
"""More than what is pickled with the numbers of an array [B]."""
_RECORD = struct.Struct("<Hdddd")
"""Index of the unit; arrival, stamp, offset, bound; then the datagram without its tag."""


@dataclass(frozen=True)
class Traffic:
    """Counts of a receiver."""

    units: tuple[UnitTraffic, ...]
    rejected: dict[str, int]
    """Datagrams thrown away, by reason (`receiver.REASONS`)."""
    unsent: int
    """Beacons the system did not take."""


class SharedOutputs:
    """Shared memory for a receiver's results; a spawned process that takes it as an argument shares it."""

    def __init__(self, units: NetworkUnits, traffic: Traffic) -> None:
        """Make them for units without measurements, with counts."""
        nothing = np.tile(NOTHING, (units.rows, 1))
        self.table = Mailbox[FloatArray](nothing.nbytes + _PICKLED, nothing)
        """The newest table (K, 7), as `SkinReceiver.table` has it."""
        self.traffic = Mailbox(4096 + sum(2560 + len(id.encode()) for id in units.ids), traffic)
        self._samples = Ring(SAMPLES_MOST, _RECORD.size + SAMPLE_MOST - TAG_SIZE)

    def put(self, receiver: SkinReceiver) -> None:
        """Write a receiver's table and its accepted samples."""
        self.table.put(receiver.table)
        for r in receiver.take_samples():
            self._samples.write(_RECORD.pack(r.unit, r.arrival, r.stamp, r.offset, r.bound) + r.sample.body())

    def take_samples(self) -> list[Received]:
        """Return the samples that came since the last call."""
        return [_received(record) for record in self._samples.take()]


def _received(record: bytes) -> Received:
    sample = sample_of(record[_RECORD.size :])
    if sample is None:
        raise RuntimeError("the length of a stored sample differs from its header")
    unit, arrival, stamp, offset, bound = _RECORD.unpack_from(record)
    return Received(unit, arrival, stamp, offset, bound, sample)


class NetworkSkin:
    """Sensor units on the network, as a `Skin`. `with` closes it."""

    def __init__(self, units: NetworkUnits | Sequence[str], keys: Keys, host: str = "127.0.0.1", port: int = 0) -> None:
        """Start a `SkinReceiver`; one that cannot listen is a HardwareError."""
        network = NetworkUnits.of(units)
        keyed = keys_of(network.ids, keys)
        demand_port(host, port)
        if current_process().daemon:
            raise HardwareError("A daemonic process cannot start a receiver: create this process with daemon=False.")
        self._owner = os.getpid()
        sides = zip(keyed, network.zones, strict=True)
        nothing = tuple(UnitTraffic(unit.id, unit.number, zones=side) for unit, side in sides)
        self._outputs = SharedOutputs(network, Traffic(nothing, {}, 0))
        context = get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        arguments = (self._owner, (network, keyed, host, port), self._outputs, theirs)
        self._process = context.Process(target=_serve, args=arguments, daemon=True)
        with kept_from_children():
            self._process.start()
        theirs.close()
        try:
            with ours:
                self.address, self.buffer_bytes = _wait_listening(ours)
        except BaseException:
            self.close()
            raise

    @property
    def alive(self) -> bool:
        """True while the receiver's process runs; only the process that started it can tell."""
        if os.getpid() != self._owner:
            raise HardwareError(f"The receiver belongs to process {self._owner}: query it in that process.")
        return self._process.is_alive()

    @property
    def pid(self) -> int:
        """Number of that process, to give it a priority or a processor."""
        return self._process.pid or 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the receiver; what it received stays. In a process forked from the one that started it, do nothing."""
        if os.getpid() != self._owner:
            return
        self._process.kill()
        self._process.join()

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit and zone, stamped with the earliest instant it can be of."""
        return range_readings(self._outputs.table.read())

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit; None while no unit has sent one."""
        return touch_readings(self._outputs.table.read())

    def take_samples(self) -> list[Received]:
        """Return the samples accepted since the last call, in their order of arrival: the newest `SAMPLES_MOST`."""
        return self._outputs.take_samples()

    def traffic(self) -> Traffic:
        """Return what the receiver has counted, not older than 0.3 s while it lives."""
        return self._outputs.traffic.read()


def _wait_listening(started: Connection) -> tuple[tuple[str, int], int]:
    """Wait for the receiver to listen: return its address, and the length of its queue [B]."""
    try:
        slow = f"The receiver did not start within {_START_S:g} s: try again."
        answer = started.recv() if started.poll(_START_S) else slow
    except EOFError:
        answer = (
            "The receiver's process ended before it listened: see what it printed (a script must start it under `if"
            ' __name__ == "__main__":`).'
        )
    if isinstance(answer, str):
        raise HardwareError(answer)
    return answer


def _serve(
    parent: int,
    listening: tuple[NetworkUnits, tuple[UnitKey, ...], str, int],
    outputs: SharedOutputs,
    started: Connection,
) -> None:
    """Receive until the parent ends, or kills this process; send it the address, or a sentence on a failure."""
    leave_to_parent()
    network, keyed, host, port = listening
    try:
        receiver = SkinReceiver(network, Keys(keyed), host, port)
    except HardwareError as error:
        started.send(str(error))
        return
    gc.collect()
    gc.freeze()
    with receiver:
        started.send((receiver.address, receiver.buffer_bytes))
        started.close()
        report_at = -1.0
        while True:
            if receiver.receive(_WAIT_S):
                outputs.put(receiver)
            now = time.monotonic()
            if now >= report_at:
                report_at = now + _TRAFFIC_PERIOD_S
                outputs.traffic.put(Traffic(receiver.units, receiver.rejected, receiver.unsent))
                if os.getppid() != parent:
                    return
            if not receiver.behind:
                time.sleep(_SHORT_PAUSE_S if receiver.received > _MANY else _PAUSE_S)
