"""A simulated skin whose readings come as real ones do: units, network, sockets, receiver, all in simulated time."""

from dataclasses import replace
from typing import Self

import numpy as np

from pretouch.errors import HardwareError
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams
from pretouch.sim.touch_sensor import Forces, no_forces
from pretouch.types import RangeReadings, TouchReadings
from pretouch.units.fleet import Fleet, FleetParams, NetworkParams, simulated_keys
from pretouch.units.receiver import SkinReceiver

_PATIENCE_S = 5.0
"""The machine's own loopback may take this long to hand a datagram over [s]."""


def network(loss: float = 0.0, overtaken: float = 0.0, doubled: float = 0.0) -> NetworkParams:
    """The default network with these fractions lost, overtaken and doubled in either direction."""
    plain = NetworkParams()
    up, down = (replace(one, loss=loss, overtaken=overtaken, doubled=doubled) for one in (plain.up, plain.down))
    return NetworkParams(up, down)


class WireSkin:
    """The port `Skin` of a simulated arm, over loopback, in lockstep with the physics.

    The receiver's clock is the simulated time, and what was sent before a physics step is taken in before it: the same
    seed gives the same readings, bit for bit. One thread; a context manager, for the sockets.
    """

    def __init__(
        self, plant: Plant, skin: Skin, ranging: RangeFinderParams, params: FleetParams, seed: int,
        laid: Forces = no_forces,
    ) -> None:  # fmt: skip
        """Mount the units on an arm and switch them on; measurements are those of `RangeFinders` with this seed.

        Units that have one by the skin file measure touches, as `TouchSensors` do: of contacts, and of forces `laid` on
        the arm.
        """
        self._plant = plant
        keys, rng = simulated_keys(skin.network.ids, seed), np.random.default_rng([seed, 8])
        self.receiver = SkinReceiver(skin.network, keys, clock=lambda: plant.time, draw=rng.bytes)
        """What came of it all: traffic of each unit, what was rejected, samples."""
        try:
            self.fleet = Fleet(skin.network, keys, params, seed, self.receiver.address)
            """The units, to be silenced, stuck, rebooted."""
        except BaseException:
            self.receiver.close()
            raise
        self._taken_in = 0
        plant.before_each_step(self._step)
        self.range_finders = self.fleet.mount(plant, skin, lambda time: time, ranging, laid)
        """What measures; `silenced` ones do not, while their units go on sending."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the sockets back."""
        self.fleet.close()
        self.receiver.close()

    def read(self) -> RangeReadings:
        """Return the newest reading of each unit."""
        return self.receiver.readings()

    def touch(self) -> TouchReadings | None:
        """Return the newest touch reading of each unit; None while no unit has told one."""
        return self.receiver.touch()

    def _step(self, now: float) -> None:
        self._taken_in += self.fleet.step(lambda: now)
        self.receiver.receive()
        while (came := self._came()) < self._taken_in:
            self.receiver.receive(timeout=_PATIENCE_S)
            if self._came() == came:
                raise HardwareError(
                    f"Only {came} of {self._taken_in} datagrams arrived through this machine's loopback interface:"
                    " check that no firewall drops UDP datagrams to 127.0.0.1."
                )

    def _came(self) -> int:
        """Datagrams that reached the receiver, whatever it made of them."""
        receiver = self.receiver
        return sum(unit.accepted + unit.hellos for unit in receiver.units) + sum(receiver.rejected.values())
