"""Receiver of all sensor units of a skin at one UDP socket (docs/reference/wire.md), with their sessions and clocks."""

import errno
import secrets
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Self

import numpy as np

from pretouch.errors import HardwareError
from pretouch.sensing.unit import NetworkUnits
from pretouch.types import FloatArray, RangeReadings, TouchReadings
from pretouch.units.keys import Keys, UnitKey
from pretouch.units.unit import NOTHING, Address, Received, UnitEndpoint, UnitTraffic
from pretouch.units.wire import HELLO_SIZE, MAGIC, SAMPLE_LEAST, VERSION, Kind, sample_size

REASONS = ("size", "format", "unit", "tag", "replayed", "no session", "too many hellos", "old hello")
"""Reasons to reject a datagram: a size, or a magic, version and kind, not ours; a unit this skin lacks; a wrong tag;
a sequence number seen already or long past; a sample of a unit without session; more hellos than are answered; a hello
of the very session that is live."""
_SO_RCVBUFFORCE = 33
"""Option of Linux that Python has no name for."""
_HEAD = struct.Struct("<4sHHI")
"""Magic, version and kind as one; number of the unit; and, of a sample, flags and sequence."""
_SAMPLE = MAGIC + bytes([VERSION, Kind.SAMPLE])
_HELLO = MAGIC + bytes([VERSION, Kind.HELLO])
_LEAST = min(HELLO_SIZE, SAMPLE_LEAST)
SAMPLES_MOST = 8192
"""Most samples kept until they are taken: 4 s of 40 units."""
DRAIN_MOST = 1024
"""Most datagrams taken in by one call of `receive`: a flood must not keep it for ever."""
BUFFER_BYTES = 4096 * 1024
"""Size asked of the system for the queue of arrived datagrams [B]; more than half of it is bookkeeping."""
_BEACON_CHECK_S = 0.02
"""Time between two looks for beacons that are due [s]."""
_CHECK_EVERY = 256
"""Datagrams after which a flood makes room for the beacons."""


def keys_of(ids: Sequence[str], keys: Keys) -> tuple[UnitKey, ...]:
    """Return the keys of a skin's units in their order; a unit without one, or named twice, is a HardwareError."""
    missing = [id for id in ids if id not in keys]
    if missing:
        raise HardwareError(f"There is no key for {', '.join(missing)}: add it to the file of keys.")
    if len(set(ids)) != len(ids):
        raise HardwareError(f"A unit is named twice in {', '.join(ids)}: name each unit once.")
    return tuple(keys[id] for id in ids)


def range_readings(table: FloatArray) -> RangeReadings:
    """Return the range readings of a table (K, 7) as `SkinReceiver.table` has it."""
    stamp, distance, status = table[:, :3].T
    return RangeReadings(stamp.copy(), distance.copy(), status.astype(np.int64))


def touch_readings(table: FloatArray) -> TouchReadings | None:
    """Return the touch readings of a table (K, 7) as `SkinReceiver.table` has it; None of one without any."""
    stamp, contact, force, status = table[:, 3:].T
    if not np.isfinite(stamp).any():
        return None
    return TouchReadings(stamp.copy(), contact != 0.0, force.copy(), status.astype(np.int64))


class SkinReceiver:
    """Receives the datagrams of a skin's units, and sends them beacons. One thread; nothing here blocks but `receive`.

    What is not genuine changes nothing but counters. `with` closes it.
    """

    def __init__(
        self,
        units: NetworkUnits | Sequence[str],
        keys: Keys,
        host: str = "127.0.0.1",
        port: int = 0,
        *,
        clock: Callable[[], float] = time.monotonic,
        draw: Callable[[int], bytes] = secrets.token_bytes,
    ) -> None:
        """Listen.

        Args:
            units: `Skin.network`, or the ids of units without zones; one without a key is a HardwareError.
            keys: of all units.
            host: address to listen at; 0.0.0.0 for every one of this machine.
            port: 0 lets the system choose one; one that is taken is a HardwareError.
            clock: gives the time [s] of all stamps.
            draw: gives so many random bytes.
        """
        network = NetworkUnits.of(units)
        keyed = keys_of(network.ids, keys)
        self.table = np.tile(NOTHING, (network.rows, 1))
        """Newest reading of each unit and zone, (K, 7), as `unit.NOTHING` has it; not to be written to."""
        self._endpoints = [
            UnitEndpoint(i, unit, side, draw, self.table[k : k + side**2])
            for i, (unit, k, side) in enumerate(zip(keyed, network.first, network.zones, strict=True))
        ]
        self._by_number = {unit.number: endpoint for unit, endpoint in zip(keyed, self._endpoints, strict=True)}
        self.units: tuple[UnitTraffic, ...] = tuple(endpoint.traffic for endpoint in self._endpoints)
        self.rejected: dict[str, int] = dict.fromkeys(REASONS, 0)
        """Number of rejected datagrams, by reason (`REASONS`)."""
        self.unsent = 0
        """Beacons the system did not take."""
        self.received = 0
        """Datagrams that the last call of `receive` took in, genuine or not."""
        self._arrivals: deque[Received] = deque(maxlen=SAMPLES_MOST)
        self._clock, self._next_beacon_check = clock, -np.inf
        self._buffer = bytearray(2048)
        self._view = memoryview(self._buffer)
        self._socket = bind(host, port)
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)
        host, port = self._socket.getsockname()[:2]
        self.address: tuple[str, int] = (host, port)
        """Address that it listens on."""

    @property
    def behind(self) -> bool:
        """True if the last call of `receive` left datagrams for the next."""
        return self.received == DRAIN_MOST

    @property
    def buffer_bytes(self) -> int:
        """Size of the queue of arrived datagrams that the system gave [B], bookkeeping included."""
        return self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop listening; received readings stay."""
        self._socket.close()

    def receive(self, timeout: float = 0.0) -> int:
        """Receive all datagrams, and send the beacons that are due; return the number of accepted samples.

        Under a flood, no more than `DRAIN_MOST` datagrams are taken in.

        Args:
            timeout: longest time to wait for a datagram if none is there [s].
        """
        if self._socket.fileno() < 0:
            raise HardwareError("The receiver is closed: make another one.")
        self._send_due_beacons()
        accepted, any_came = self._drain()
        if any_came or timeout <= 0:
            return accepted
        end = time.monotonic() + timeout
        while (left := end - time.monotonic()) > 0:
            if self._poll.poll(1e3 * min(left, _BEACON_CHECK_S)):
                self._send_due_beacons()
                return self._drain()[0]
            self._send_due_beacons()
        return 0

    def readings(self) -> RangeReadings:
        """Return the newest reading of each unit and zone, stamped with the earliest instant it can be of."""
        return range_readings(self.table)

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit; None while no unit has sent one."""
        return touch_readings(self.table)

    def take_samples(self) -> list[Received]:
        """Return the samples accepted since the last call as they arrived, the newest `SAMPLES_MOST`."""
        arrivals = list(self._arrivals)
        self._arrivals.clear()
        return arrivals

    def _drain(self) -> tuple[int, bool]:
        """Receive waiting datagrams; return the number of accepted samples, and whether anything came at all."""
        take, buffer, view, clock = self._socket.recvfrom_into, self._buffer, self._view, self._clock
        accepted = 0
        for k in range(DRAIN_MOST):
            try:
                size, address = take(buffer)
            except BlockingIOError:
                self.received = k
                return accepted, k > 0
            except OSError as error:  # news of an earlier beacon that found nobody
                if error.errno in (errno.EBADF, errno.ENOTSOCK):
                    raise HardwareError("The receiver's socket was closed: make another receiver.") from None
                continue
            reason = self._take_in(view[:size], size, address, clock())
            if reason is None:
                accepted += 1
            elif reason:
                self.rejected[reason] += 1
            if not k % _CHECK_EVERY:
                self._send_due_beacons()
        self.received = DRAIN_MOST
        return accepted, True

    def _take_in(self, datagram: memoryview, size: int, address: Address, now: float) -> str | None:
        """Handle one datagram: return None for a sample, "" for a hello, or the reason to reject it."""
        if size < _LEAST:
            return "size"
        head, number, _, sequence = _HEAD.unpack_from(datagram)
        if head == _SAMPLE:
            if size < SAMPLE_LEAST or sample_size(datagram) != size:
                return "size"
        elif head != _HELLO:
            return "format"
        elif size != HELLO_SIZE:
            return "size"
        endpoint = self._by_number.get(number)
        if endpoint is None:
            return "unit"
        if head == _HELLO:
            answer = endpoint.hello(datagram, now)
            if isinstance(answer, str):
                return answer
            self._send(answer, address)
            return ""
        received = endpoint.sample(datagram, sequence, address, now)
        if isinstance(received, str):
            return received
        self._arrivals.append(received)
        return None

    def _send_due_beacons(self) -> None:
        """Send the beacons that are due."""
        now = self._clock()
        if now < self._next_beacon_check:
            return
        self._next_beacon_check = now + _BEACON_CHECK_S
        for endpoint in self._endpoints:
            if endpoint.beacon_due(now) and endpoint.address is not None:
                self._send(endpoint.beacon(self._clock()), endpoint.address)

    def _send(self, beacon: bytes, address: Address) -> None:
        """Send, or count what cannot be sent: another beacon follows."""
        try:
            self._socket.sendto(beacon, address)
        except OSError:
            self.unsent += 1


def demand_port(host: str, port: int) -> None:
    """Raise a HardwareError for an invalid port."""
    if type(port) is not int or not 0 <= port <= 0xFFFF:
        raise HardwareError(
            f"The port {port!r} for {host} is not valid: choose one from 1 to 65535, or 0 for any free port."
        )


def bind(host: str, port: int) -> socket.socket:
    """Open a socket that never blocks, at this address; a failure is a HardwareError."""
    demand_port(host, port)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host or None, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        bound = socket.socket(family, kind, protocol)
    except (OSError, UnicodeError) as error:
        raise HardwareError(f"The address {host}, port {port}, cannot be listened on: {error}.") from None
    try:
        bound.setblocking(False)
        _widen(bound)
        bound.bind(address)
    except OSError as error:
        bound.close()
        if error.errno == errno.EADDRINUSE:
            raise HardwareError(
                f"Port {port} of {host} is in use: end the program that listens there, or choose another port."
            ) from None
        raise HardwareError(f"Listening on {host}, port {port}, failed: {error.strerror}.") from None
    return bound


def _widen(bound: socket.socket) -> None:
    """Request a long queue: beyond the system's limit if that is allowed."""
    try:
        bound.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, BUFFER_BYTES)
    except PermissionError:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
