"""A network that loses, delays, overtakes and doubles datagrams, as a wireless one does. No socket, no clock."""

from dataclasses import dataclass, field, replace
from typing import Annotated, Generic, TypeVar

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.errors import ParameterError
from pretouch.sim.under_way import UnderWay

Item = TypeVar("Item")


@dataclass(frozen=True)
class ChannelParams(Checked):
    """Loss and delay of datagrams in one direction. By default none is lost, and all are late."""

    loss: Annotated[float, Check(low=0.0, high=1.0)] = 0.0
    """Probability that a datagram is lost."""
    loss_run: NonNegative = 0.0
    """Mean number of datagrams of one unit lost in a row; 0: each is lost or not by itself, 1 / (1 - loss) in a row."""
    delay_s: NonNegative = 0.008
    """Least delay [s]."""
    jitter_s: NonNegative = 0.004
    """Mean of what is added to it [s], distributed as gamma."""
    jitter_shape: Positive = 1.0
    """Shape of that distribution; 1 is exponential."""
    overtaken: Fraction = 0.0
    """Probability that a datagram is held up, so that later ones overtake it."""
    held_up_s: NonNegative = 0.05
    """For how long it is held up [s]: two to three samples of a unit."""
    doubled: Fraction = 0.0
    """Probability that a datagram arrives twice, the second time after delays of its own."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if 0 < self.loss_run < 1:
            raise ParameterError(f"ChannelParams.loss_run is {self.loss_run}: it must be 0, or at least 1.")
        least = self.loss / (1.0 - self.loss) if self.loss < 1 else 0.0
        if 0 < self.loss_run < least:
            raise ParameterError(
                f"ChannelParams.loss_run is {self.loss_run}: give at least {least:.3g} for a loss of {self.loss:g}."
            )


def _down() -> ChannelParams:
    return ChannelParams(delay_s=0.0012, jitter_s=0.0012, jitter_shape=2.0)


@dataclass(frozen=True)
class NetworkParams(Checked):
    """The network between the units of a skin and their receiver."""

    up: ChannelParams = field(default_factory=ChannelParams)
    """From units to receiver: latency and jitter as of `sim.range_finder.RangeFinderParams`."""
    down: ChannelParams = field(default_factory=_down)
    """From receiver to units: a quiet access point, with power saving of the units off."""


def network(
    loss: float = 0.0, jitter: float | None = None, overtaken: float = 0.0, doubled: float = 0.0
) -> NetworkParams:
    """Return the default network with these fractions lost, overtaken and doubled in either direction.

    `jitter` is the mean of what is added to the least delay upwards [s]; None for the default.
    """
    plain = NetworkParams()
    up, down = (replace(channel, loss=loss, overtaken=overtaken, doubled=doubled) for channel in (plain.up, plain.down))
    return NetworkParams(up if jitter is None else replace(up, jitter_s=jitter), down)


class Channel(Generic[Item]):
    """One direction of the network for the datagrams of one unit; the same random numbers give the same course."""

    def __init__(self, params: ChannelParams, rng: np.random.Generator) -> None:
        self._params, self._rng = params, rng
        self._sent = UnderWay[Item]()
        self._losing = False
        self.lost = 0
        """How many were lost so far."""

    def put(self, item: Item, now: float) -> None:
        """Send a datagram at a time [s]."""
        if self._loses():
            self.lost += 1
            return
        for _ in range(1 + int(self._rng.random() < self._params.doubled)):
            self._sent.send(now + self._delay(), item)

    def take(self, now: float) -> list[Item]:
        """Return what has arrived by a time [s] and was not taken yet, in the order of arrival."""
        return list(self._sent.arrived(now))

    def _loses(self) -> bool:
        """Whether this one is lost; in runs, by the chain of two states that has this loss and this mean run."""
        p, draw = self._params, float(self._rng.random())
        if not p.loss_run or p.loss in (0.0, 1.0):
            return draw < p.loss
        begins = p.loss / (p.loss_run * (1.0 - p.loss))
        self._losing = draw < (1.0 - 1.0 / p.loss_run if self._losing else begins)
        return self._losing

    def _delay(self) -> float:
        p, rng = self._params, self._rng
        held_up = p.held_up_s if rng.random() < p.overtaken else 0.0
        return p.delay_s + float(rng.gamma(p.jitter_shape, p.jitter_s / p.jitter_shape)) + held_up
