"""The arms that `pretouch run` can move, each opened as the ports that a session needs."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Protocol

from pretouch.cli.run.options import Run
from pretouch.cli.run.parts import Parts
from pretouch.cli.skin_keys import keys_file
from pretouch.controller import Controller
from pretouch.hardware.address import HOST
from pretouch.hardware.keys import Keys, load_keys
from pretouch.hardware.network_skin import NetworkSkin
from pretouch.loop import Recorder
from pretouch.ports import Skin
from pretouch.robot.model import RobotModel
from pretouch.session.arm import Arm
from pretouch.session.push import Direction
from pretouch.session.remembered import Identity
from pretouch.session.session import NoUnits
from pretouch.session.signals import children_undisturbed
from pretouch.session.units import Units


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
def opened(command: Run, parts: Parts) -> Iterator[Opened]:
    """Open the arm that the command names, and hear its units."""
    match command.robot.robot:
        case "simulated":
            way = _simulated(command, parts)
        case "franka":
            from pretouch.cli.run.franka import franka

            way = franka(command, parts)
        case "ros2":
            from pretouch.cli.run.ros2 import ros2

            way = ros2(command, parts)
    with way as found:
        yield found


@contextmanager
def network_units(command: Run, parts: Parts, keys: Keys | None = None) -> Iterator[NetworkSkin | None]:
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


@contextmanager
def _simulated(command: Run, parts: Parts) -> Iterator[Opened]:
    from pretouch.serving.simulated_arm import SimulateOptions
    from pretouch.serving.wire_skin import made_keys
    from pretouch.session.simulated import SimulatedSessionArm
    from pretouch.sim.scene import SceneSpec

    model, keys = RobotModel(parts.model.description), made_keys(parts.skin.ids, command.seed)
    with network_units(command, parts, keys) as units:
        port = units.address[1] if units else 9
        options = SimulateOptions(model, parts.skin, keys, HOST, port, hand=False, seed=command.seed)
        begin = parts.simulated_start()
        with SimulatedSessionArm(options, begin, SceneSpec(floor_height=parts.floor)) as arm:
            yield Opened(
                arm, units or NoUnits(), None, units, lambda direction: arm.push(direction.axis),
                learnt_as=f"{arm.name}, seed {command.seed}",
            )  # fmt: skip
