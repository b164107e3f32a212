"""Simulated units of a skin, each with its own UDP socket and its own simulated network channel.

The network loses, delays, overtakes and doubles datagrams, as a wireless one does.
"""

import socket
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from itertools import count
from typing import Annotated, Generic, TypeVar

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.errors import HardwareError
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import NetworkUnits
from pretouch.sim.imu import ImuParams, Imus, ImuSample
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders, RangeSample
from pretouch.sim.touch_sensor import Forces, TouchErrors, TouchSample, TouchSensors, no_forces
from pretouch.sim.under_way import UnderWay
from pretouch.units.keys import KEY_SIZE, Keys, UnitKey
from pretouch.units.receiver import keys_of
from pretouch.units.simulated import SimulatedUnit, UnitParams

Measured = TypeVar("Measured", RangeSample, ImuSample, TouchSample)
Item = TypeVar("Item")
_LARGEST = 2048
_LAST_PORT = 0xFFFF


@dataclass(frozen=True)
class ChannelParams(Checked):
    """Loss and delay of datagrams in one direction. By default none is lost, and all are late."""

    loss: Annotated[float, Check(low=0.0, high=1.0)] = 0.0
    """Probability that a datagram is lost."""
    delay_s: NonNegative = 0.008
    """Least delay [s]."""
    jitter_s: NonNegative = 0.004
    """Mean of the additional delay [s], which has a gamma distribution."""
    jitter_shape: Positive = 1.0
    """Shape of that distribution; 1 is exponential."""
    overtaken: Fraction = 0.0
    """Probability that a datagram is held up, so that later ones overtake it."""
    held_up_s: NonNegative = 0.05
    """Time that it is held up [s]: two to three samples of a unit."""
    doubled: Fraction = 0.0
    """Probability that a datagram arrives twice, the second time after delays of its own."""


@dataclass(frozen=True)
class NetworkParams(Checked):
    """The network between the units of a skin and their receiver."""

    up: ChannelParams = ChannelParams()
    """Channel from units to receiver: latency and jitter as of `sim.range_finder.RangeFinderParams`."""
    down: ChannelParams = ChannelParams(delay_s=0.0012, jitter_s=0.0012, jitter_shape=2.0)
    """Channel from receiver to units: a quiet access point, with power saving of the units off."""


class Channel(Generic[Item]):
    """One direction of the network for the datagrams of one unit; the same random numbers give the same course."""

    def __init__(self, params: ChannelParams, rng: np.random.Generator) -> None:
        self._params, self._rng = params, rng
        self._sent = UnderWay[Item]()
        self.lost = 0
        """Number of datagrams lost so far."""

    def put(self, item: Item, now: float) -> None:
        """Send a datagram at a time [s]."""
        p, rng = self._params, self._rng
        if rng.random() < p.loss:
            self.lost += 1
            return
        for _ in range(1 + int(rng.random() < p.doubled)):
            held_up = p.held_up_s if rng.random() < p.overtaken else 0.0
            delay = p.delay_s + float(rng.gamma(p.jitter_shape, p.jitter_s / p.jitter_shape)) + held_up
            self._sent.send(now + delay, item)

    def take(self, now: float) -> list[Item]:
        """Return what has arrived by a time [s] and was not taken yet, in the order of arrival."""
        return list(self._sent.arrived(now))


@dataclass(frozen=True)
class FleetParams(Checked):
    """Units, and the network between them and their receiver."""

    network: NetworkParams = NetworkParams()
    """Loss and delay of datagrams."""
    unit: UnitParams = field(default_factory=UnitParams)
    """Clocks and sessions of the units."""
    imu: ImuParams | None = None
    """Errors of their IMUs; None: the units have no IMU."""
    reboot_every_s: NonNegative = 0.0
    """Time from each reboot of a unit to its next one, the first at a random part of it [s]; 0: none."""


class Fleet:
    """All units of a skin. Only `step` advances them."""

    def __init__(
        self, units: NetworkUnits | Iterable[str], keys: Keys, params: FleetParams, seed: int, address: tuple[str, int]
    ) -> None:
        """Switch the units on: `Skin.network`, or the ids of units without zones.

        The seed decides clocks, challenges, reboots and the network's course.

        A unit without a key, and an address that cannot be found, are a HardwareError.
        """
        network = NetworkUnits.of(units)
        ids = self.ids = network.ids
        family, self._address = _resolved(address)
        seeds = np.random.SeedSequence([seed, 6]).spawn(len(ids))
        rngs = [[np.random.default_rng(s) for s in one.spawn(3)] for one in seeds]
        self._params, self.seed = params, seed
        self.units = tuple(
            SimulatedUnit(key, params.unit, own, params.imu, _reboots(params.reboot_every_s, own), side)
            for key, side, (own, _, _) in zip(keys_of(ids, keys), network.zones, rngs, strict=True)
        )
        """Units in the order of the skin."""
        self._rows = [
            (unit, zone) for unit, side in zip(self.units, network.zones, strict=True) for zone in range(side**2)
        ]
        self._up = [Channel[bytes](params.network.up, rng) for _, rng, _ in rngs]
        self._down = [Channel[bytes](params.network.down, rng) for _, _, rng in rngs]
        self._sockets = [socket.socket(family, socket.SOCK_DGRAM) for _ in ids]
        for one in self._sockets:
            one.setblocking(False)
        self.sent = 0
        """Datagrams that reached the socket."""
        self.lost = 0
        """Datagrams that the machine refused to send, as while its network is down."""

    def mount(
        self,
        plant: Plant,
        skin: Skin,
        at: Callable[[float], float | None],
        ranging: RangeFinderParams | None = None,
        laid: Forces = no_forces,
    ) -> RangeFinders:
        """Let the units measure on a simulated arm that has not moved yet; return their range finders.

        Args:
            plant: the arm.
            skin: the units on it; one with a touch sensor by the skin file measures touches.
            at: gives the units' time at an instant of the arm's [s]; None while they measure nothing.
            ranging: how range finders err.
            laid: forces that act on the arm without a contact of the simulation.
        """

        def handed_to(take: Callable[[Measured], None]) -> Callable[[Measured], None]:
            def hand_on(sample: Measured) -> None:
                time = at(sample.time)
                if time is not None:
                    take(sample._replace(time=time))

            return hand_on

        finders = RangeFinders(plant, skin, ranging or RangeFinderParams(), self.seed, handed_to(self.take_range))
        if finders.params.realistic:
            for unit, mounted in zip(self.units, skin.mounted, strict=True):
                unit.delay_s = mounted.sensor.timing[1]
        if len(skin.touching):
            TouchSensors(plant, skin, TouchErrors(), self.seed, laid, handed_to(self.take_touch))
        if self._params.imu is not None:
            Imus(plant, skin, self._params.imu, self.seed, handed_to(self.take_imu))
        return finders

    def set_faults(self, silenced: Collection[str], stuck: Collection[str]) -> None:
        """Let units send nothing, or repeat their first range; a name that no unit has is a HardwareError."""
        unknown = sorted({*silenced, *stuck} - set(self.ids))
        if unknown:
            raise HardwareError(f"Unknown unit {', '.join(unknown)}: choose from {', '.join(self.ids)}.")
        for name, unit in zip(self.ids, self.units, strict=True):
            unit.silent, unit.stuck = name in silenced, name in stuck

    def take_range(self, sample: RangeSample) -> None:
        """Let a unit's range finder measure, or one of its zones."""
        unit, zone = self._rows[sample.unit]
        unit.take_range(sample, zone)

    def take_touch(self, sample: TouchSample) -> None:
        """Let a unit's touch sensor measure."""
        self._rows[sample.unit][0].take_touch(sample)

    def take_imu(self, sample: ImuSample) -> None:
        """Let a unit's IMU take a sample."""
        self._rows[sample.unit][0].take_imu(sample)

    def step(self, clock: Callable[[], float]) -> int:
        """Deliver received datagrams, run the units, send what is due by now; return the number sent.

        `clock` gives the time [s]. It is asked once, after the sockets: no beacon is heard before it was sent.
        """
        before, arrived = self.sent, [_heard(one) for one in self._sockets]
        now = clock()
        for unit, came, down, up, one in zip(self.units, arrived, self._down, self._up, self._sockets, strict=True):
            for datagram in came:
                down.put(datagram, now)
            for datagram in down.take(now):
                unit.receive_beacon(datagram, now)
            for datagram in unit.tick(now):
                up.put(datagram, now)
            for datagram in up.take(now):
                self._send(one, datagram)
        return self.sent - before

    def _send(self, one: socket.socket, datagram: bytes) -> None:
        try:
            one.sendto(datagram, self._address)
            self.sent += 1
        except OSError:
            self.lost += 1

    def close(self) -> None:
        """Close the sockets."""
        for one in self._sockets:
            one.close()


def simulated_keys(ids: tuple[str, ...], seed: int) -> Keys:
    """Keys that are the same with the same seed: for simulated units alone."""
    rng = np.random.default_rng([seed, 7])
    return Keys(UnitKey(name, number, rng.bytes(KEY_SIZE)) for number, name in enumerate(ids, 1))


def _reboots(every: float, rng: np.random.Generator) -> "count[float] | tuple[()]":
    return count(every * float(rng.uniform()), every) if every > 0 else ()


def _resolved(address: tuple[str, int]) -> tuple[int, tuple[object, ...]]:
    """Family and address of a receiver by its name and port."""
    host, port = address
    if not host:
        raise HardwareError("The receiver's address is empty: give its name or address.")
    if not 1 <= port <= _LAST_PORT:
        raise HardwareError(f"The receiver's port is {port}: give one from 1 to {_LAST_PORT}.")
    try:
        family, _, _, _, resolved = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    except (OSError, UnicodeError) as error:
        raise HardwareError(f"The receiver {host}:{port} cannot be found ({error}): check its name and port.") from None
    return family, resolved


def _heard(one: socket.socket) -> list[bytes]:
    """All datagrams that wait at a socket."""
    arrived = []
    while True:
        try:
            arrived.append(one.recv(_LARGEST))
        except BlockingIOError:
            return arrived
        except ConnectionError:  # nobody listens at the receiver's port; it may begin to
            continue
