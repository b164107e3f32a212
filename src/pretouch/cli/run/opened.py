"""What `pretouch run` holds of an arm that has been opened, and the units that every arm may have on the network."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from pretouch.cli.run.parts import Parts
from pretouch.cli.skin_keys import keys_file
from pretouch.controller import Controller
from pretouch.hardware.keys import Keys, load_keys
from pretouch.hardware.network_skin import NetworkSkin
from pretouch.loop import Recorder
from pretouch.ports import Skin
from pretouch.session.arm import Arm
from pretouch.session.push import Direction
from pretouch.session.remembered import Identity
from pretouch.session.units import Units
from pretouch.signals import children_undisturbed

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run


class Output(Recorder, Protocol):
    """What else is told of each control step."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of that, a sentence each."""
        ...


def _no_output(_controller: Controller) -> AbstractContextManager[Output | None]:
    return nullcontext()


@dataclass(frozen=True)
class Opened:
    """An arm that can be read, and its units."""

    arm: Arm
    skin: Skin
    identity: Identity | None
    """By which its confirmed force sign is remembered; None: it is not."""
    units: Units | None = None
    """What hears the units, where their health can be told."""
    asked: Callable[[Direction], None] = lambda _: None
    """Called as a person is asked to push: a simulated one does."""
    notes: Callable[[], tuple[str, ...]] = lambda: ()
    """What is to be known of the connection by now, a sentence each."""
    output: Callable[[Controller], AbstractContextManager[Output | None]] = _no_output
    """Opens what else is told of each control step."""
    learnt_as: str = ""
    """What the robot is known by as its free motion is remembered, where that may be learnt."""


@contextmanager
def network_units(command: "Run", parts: Parts, keys: Keys | None = None) -> Iterator[NetworkSkin | None]:
    """Hear the units over the network, if there are any."""
    if not len(parts.skin):
        yield None
        return
    c = command.units
    keys = load_keys(keys_file(c.keys)) if keys is None else keys
    with children_undisturbed():
        receiver = NetworkSkin(parts.skin.ids, keys, c.units_host, c.units_port)
    with receiver as units:
        print(f"Units are heard at {units.address[0]}:{units.address[1]}.", flush=True)
        yield units
