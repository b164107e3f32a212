"""The port `Skin` over the network: the receiver in a process of its own, the newest values in shared memory.

A flood, a slow disk or a garbage collection in one process does not stop the other. If the receiver's process dies,
readings grow old, which the controller names as silence. If the program that started it dies, it ends too, and the
memory between them has no name that could be left over.
"""

import os
from collections.abc import Sequence
from multiprocessing import current_process, get_context
from multiprocessing.connection import Connection
from signal import SIGINT
from typing import Self

import numpy as np

from pretouch.errors import HardwareError
from pretouch.sensing.unit import NetworkUnits
from pretouch.signals import kept_from_children
from pretouch.types import RangeReadings, RangeStatus, TouchReadings
from pretouch.units.keys import Keys
from pretouch.units.link import LinkParams
from pretouch.units.receiver import keys_of, touch_readings
from pretouch.units.receiver_process import SharedOutputs, Traffic, serve
from pretouch.units.traffic import ImuBatch, Received, UnitTraffic, imu_batch
from pretouch.units.udp import demand_port

_START_S = 60.0
"""Longest time a process may take to start [s]: it imports everything anew."""


class NetworkSkin:
    """Sensor units on the network, as a `Skin`. `with` closes it."""

    def __init__(
        self,
        units: NetworkUnits | Sequence[str],
        keys: Keys,
        host: str = "127.0.0.1",
        port: int = 0,
        params: LinkParams | None = None,
        *,
        priority: int | None = None,
    ) -> None:
        """Start a receiver; one that cannot listen, or not have its priority, is a HardwareError.

        Args:
            units: see `SkinReceiver`.
            keys: see `SkinReceiver`.
            host: see `SkinReceiver`.
            port: see `SkinReceiver`.
            params: see `SkinReceiver`.
            priority: of its process in the scheduling class SCHED_FIFO, 1 to 99, below that of the control loop; None
                leaves the class as it is.
        """
        self.network = NetworkUnits.of(units)
        """Whom it hears."""
        known, rows = keys_of(self.network.ids, keys), self.network.rows
        demand_port(host, port)
        if current_process().daemon:
            raise HardwareError("A daemonic process cannot start a receiver: create this process with daemon=False.")
        self._owner = os.getpid()
        self._params = params or LinkParams()
        self._outputs = SharedOutputs(self.network, self._params.samples_most)
        none = np.full(rows, int(RangeStatus.NONE))
        self._nothing = RangeReadings(np.full(rows, -np.inf), np.zeros(rows), none)
        self._no_traffic = Traffic(
            tuple(
                UnitTraffic(unit.id, unit.number, zones=side)
                for unit, side in zip(known, self.network.zones, strict=True)
            ),
            {},
            0,
        )
        self._imu: list[Received] = []
        self._samples: list[Received] = []
        context = get_context("spawn")
        ours, theirs = context.Pipe(duplex=False)
        arguments = (self._owner, known, (host, port), self._params, priority, self._outputs, theirs)
        self._process = context.Process(target=serve, args=arguments, daemon=True)
        with kept_from_children({SIGINT}):
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
        """Whether the receiver's process runs; only the process that started it can tell."""
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
        value = self._outputs.readings()
        if value is None:
            return self._nothing
        table = np.frombuffer(value).reshape(3, -1)
        return RangeReadings(table[0].copy(), table[1].copy(), table[2].astype(np.int64))

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit; None while no unit has told one."""
        value = self._outputs.touch()
        return None if value is None else touch_readings(np.frombuffer(value).reshape(4, -1))

    def take_samples(self) -> list[Received]:
        """Return the samples accepted since the last call, in their order of arrival."""
        self._take()
        taken, self._samples = self._samples, []
        return taken

    def take_imu(self) -> list[ImuBatch]:
        """Return the IMU samples that came since the last call, but for those of no known instant, scale or rate."""
        self._take()
        taken, self._imu = self._imu, []
        return [batch for batch in map(imu_batch, taken) if batch is not None]

    def traffic(self) -> Traffic:
        """Return what the receiver has counted, not older than 0.6 s while it lives."""
        return self._outputs.traffic() or self._no_traffic

    def _take(self) -> None:
        """Share what came between the two who take it; what one of them never takes is bounded."""
        came, most = self._outputs.take_samples(), self._params.samples_most
        self._samples += came
        self._imu += [received for received in came if received.sample.imu_count]
        del self._samples[:-most], self._imu[:-most]


def _wait_listening(started: Connection) -> tuple[tuple[str, int], int]:
    """Wait for the receiver to listen: return its address, and the length of its queue [B]."""
    try:
        answer = (
            started.recv()
            if started.poll(_START_S)
            else (f"The receiver did not start within {_START_S:g} s: try again.")
        )
    except EOFError:
        answer = (
            "The receiver's process ended before it listened: see what it printed (a script must start it under `if"
            ' __name__ == "__main__":`).'
        )
    if isinstance(answer, str):
        raise HardwareError(answer)
    return answer
