"""The arm's sensor units, which speak for themselves over UDP: nothing of them is in the robot's interface."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from pretouch.sensing.skin import Skin
from pretouch.sim.imu import ImuParams
from pretouch.sim.plant import Plant
from pretouch.units.fleet import Fleet, FleetParams, NetworkParams
from pretouch.units.keys import Keys


@dataclass(frozen=True)
class UnitsSetup:
    """Sensor units, and the address that they send to."""

    skin: Skin
    keys: Keys
    """Keys of all of them; the receiver has the same."""
    address: tuple[str, int]
    """Name or address of the receiver, and its UDP port."""
    loss: float = 0.0
    """Share of datagrams lost, in either direction."""


class ServedUnits:
    """Units mounted on an arm, and the network to their receiver."""

    def __init__(self, plant: Plant, setup: UnitsSetup, seed: int) -> None:
        """Mount them on an arm that has not moved yet.

        A receiver that cannot be found, and a unit without a key, are a HardwareError.
        """
        network = NetworkParams()
        lossy = NetworkParams(replace(network.up, loss=setup.loss), replace(network.down, loss=setup.loss))
        self._fleet = Fleet(setup.skin.network, setup.keys, FleetParams(lossy, imu=ImuParams()), seed, setup.address)
        self.offset: float | None = None
        """Offset of their time from the plant's [s]; None: they measure nothing yet."""
        self._fleet.mount(plant, setup.skin, lambda time: None if self.offset is None else time + self.offset)

    def step(self, clock: Callable[[], float]) -> None:
        """Let them hear and say what is due by their time [s]."""
        self._fleet.step(clock)

    def close(self) -> None:
        """Give the sockets back."""
        self._fleet.close()
