"""An arm on ROS 2 for `pretouch run`."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, cast

from pretouch.cli.run.setup import OpenedRobot, RunSetup
from pretouch.errors import HardwareError
from pretouch.hardware.ros2.params import (
    ArmParams,
    CommanderParams,
    Frame,
    NodeParams,
    OutputParams,
    Sign,
    SkinParams,
)

if TYPE_CHECKING:
    from pretouch.cli.run.options import RobotOptions, Run

_PATIENCE_S = 10.0


@contextmanager
def ros2(command: "Run", setup: RunSetup) -> Iterator[OpenedRobot]:
    """Join the others on ROS 2, hear arm and units, and publish each control step."""
    from pretouch.hardware.ros2.commander import Ros2Commander
    from pretouch.hardware.ros2.node import Ros2Node
    from pretouch.hardware.ros2.output import Ros2Output
    from pretouch.hardware.ros2.robot import Ros2Robot
    from pretouch.hardware.ros2.skin import Ros2Skin
    from pretouch.session.ros2 import Ros2SessionArm, identity
    from pretouch.session.session import NoUnits

    if command.units.keys:
        raise HardwareError("--keys does not go with --robot ros2, whose units are topics: leave it out.")
    o = command.robot
    joined, arm = _params(o)
    known = identity(joined, arm)
    period = setup.profile.task.control_period_s
    with ExitStack() as stack:
        node = stack.enter_context(Ros2Node(joined))
        robot = stack.enter_context(Ros2Robot(arm, setup.model, node, period))
        robot.wait(_PATIENCE_S)
        asks = None
        if o.ros_desired:
            asked = CommanderParams(o.ros_desired, o.ros_desired_topic, arm.shared_clock, o.ros_base_frame)
            asks = Ros2Commander(asked, robot, setup.model, node)
        ranges = SkinParams(o.ros_ranges)
        units = stack.enter_context(Ros2Skin(ranges, setup.skin, node)) if len(setup.skin) else None
        if units:
            units.wait(_PATIENCE_S)
        yield OpenedRobot(
            Ros2SessionArm(robot, setup.model.n), units or NoUnits(), known,
            notes=lambda: tuple(said for one in (robot, units, asks) if one is not None for said in one.notes),
            output=lambda controller: Ros2Output(OutputParams(base_frame=o.ros_base_frame), controller, node),
            free_motion_id=known.key, commander=asks,
        )  # fmt: skip


def _params(robot: "RobotOptions") -> tuple[NodeParams, ArmParams]:
    sign, frame = cast(Sign, robot.ros_sign), cast(Frame, robot.ros_frame)  # the options were checked for ''
    node = NodeParams(robot.ros_distribution, robot.ros_domain, robot.ros_interface)
    return node, ArmParams(
        sign, frame, joint_states=robot.ros_joint_states, joint_names=robot.ros_joints, wrench=robot.ros_wrench,
        torques=robot.ros_torques, shared_clock=not robot.ros_own_clock, command_topic=robot.ros_commands,
    )  # fmt: skip
