"""The arms that `pretouch run` can move, each opened as the ports that a session needs."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pretouch.cli.run.setup import OpenedRobot, RunSetup, network_units
from pretouch.extras import ROS2
from pretouch.hardware.address import HOST
from pretouch.hardware.franka.client import need_library
from pretouch.robot.model import RobotModel
from pretouch.session.session import NoUnits

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run


if TYPE_CHECKING:
    from pretouch.cli.run.options import Run


def need_extra(command: "Run") -> None:
    """Refuse an arm whose libraries are not installed, before anything imports them."""
    match command.robot.robot:
        case "franka":
            need_library(command.robot.kind)
        case "ros2":
            ROS2.need("An arm on ROS 2")


@contextmanager
def opened(command: "Run", setup: RunSetup) -> Iterator[OpenedRobot]:
    """Open the arm that the command names, and hear its units."""
    match command.robot.robot:
        case "simulated":
            way = _simulated(command, setup)
        case "franka":
            from pretouch.cli.run.franka import franka

            way = franka(command, setup)
        case "ros2":
            from pretouch.cli.run.ros2 import ros2

            way = ros2(command, setup)
    with way as found:
        yield found


@contextmanager
def _simulated(command: "Run", setup: RunSetup) -> Iterator[OpenedRobot]:
    from pretouch.serving.simulated_arm import SimulateOptions
    from pretouch.serving.wire_skin import made_keys
    from pretouch.session.simulated import SimulatedSessionArm
    from pretouch.sim.scene import SceneSpec

    model, keys = RobotModel(setup.model.description), made_keys(setup.skin.network.ids, command.seed)
    with network_units(command, setup, keys) as units:
        port = units.address[1] if units else 9
        options = SimulateOptions(model, setup.skin, keys, HOST, port, hand=False, seed=command.seed)
        begin = setup.simulated_start()
        with SimulatedSessionArm(options, begin, SceneSpec(floor_height=setup.floor)) as arm:
            yield OpenedRobot(
                arm, units or NoUnits(), None, units, lambda direction: arm.push(direction.axis),
                free_motion_id=f"{arm.name}, seed {command.seed}",
            )  # fmt: skip
