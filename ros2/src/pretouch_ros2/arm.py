"""An arm on ROS 2 for `pretouch run`."""

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal

from pretouch.arms import ArmOptions, ArmSetup, OpenedArm
from pretouch.errors import ParameterError
from pretouch_ros2.params import ArmParams, NodeParams

if TYPE_CHECKING:
    from pretouch.session.memory import Identity

_PATIENCE_S = 10.0


@dataclass(frozen=True)
class Ros2(ArmOptions):
    """An arm behind topics of ROS 2."""

    arm: ArmParams
    node: NodeParams = field(default_factory=NodeParams)
    ranges: str = "/skin/{unit}/range"
    """Topic of the units' ranges; {unit} stands for the id of each."""
    desired: Literal["", "twist", "trajectory"] = ""
    """The arm follows a commander in place of a path: a TwistStamped, or the velocities of a JointTrajectory."""
    desired_topic: str = ""
    """Its topic; by default /pretouch/twist or /pretouch/joint_trajectory."""
    base_frame: str = ""
    """Name of the base frame, beside the model's own."""
    brings_units: ClassVar[bool] = True

    @property
    def commanded(self) -> bool:
        """True if a commander is followed."""
        return bool(self.desired)

    def check(self, setup: ArmSetup) -> None:
        """Refuse a topic of nothing, and a profile that needs torques where there are none."""
        if self.desired_topic and not self.desired:
            raise ParameterError("--desired-topic needs --desired, the kind of its messages: give both.")
        profile = setup.profile
        if (profile.detect.by_torques or profile.react.by_torques) and not self.arm.torques:
            raise ParameterError(
                f"The profile {profile.name} detects contacts by external joint torques: give their topic by --torques,"
                " or choose --profile paper, or pretouch:detect=thresholds:react=decay."
            )

    @contextmanager
    def open(self, setup: ArmSetup) -> Iterator[OpenedArm]:
        """Join the others, hear the arm and its units, and publish each control step."""
        from pretouch_ros2.commander import Ros2Commander
        from pretouch_ros2.node import Ros2Node
        from pretouch_ros2.output import Ros2Output
        from pretouch_ros2.robot import Ros2Robot
        from pretouch_ros2.skin import Ros2Skin

        robot_known = identity(self.node, self.arm)
        with ExitStack() as stack:
            node = stack.enter_context(Ros2Node(self.node))
            period = setup.profile.task.control_period_s
            robot = stack.enter_context(Ros2Robot(self.arm, setup.model, node, period))
            robot.wait(_PATIENCE_S)
            commander = skin = None
            if self.desired:
                commander = Ros2Commander(self.desired, robot, setup.model, node, self.desired_topic, self.base_frame)
            if setup.units:
                skin = Ros2Skin(setup.skin, node, self.ranges)
                skin.wait(_PATIENCE_S)
            sources = [source for source in (robot, skin, commander) if source is not None]
            yield OpenedArm(
                robot,
                robot_known,
                skin,
                notes=lambda: tuple(note for source in sources for note in source.notes),
                output=lambda controller: closing(Ros2Output(controller, node, self.base_frame)),
                free_motion_id=robot_known.key,
                commander=commander,
                announced=commander.announced if commander else "",
            )


def identity(node: NodeParams, arm: ArmParams) -> "Identity":
    """Return what a robot is known by: its topics, and the settings that say what they mean."""
    from pretouch.session.memory import Identity
    from pretouch_ros2.network import domain_of

    where = ", ".join(filter(None, (node.interface, f"domain {domain_of(node)}", arm.wrench, arm.torques)))
    return Identity("ros2", where, f"sign {arm.sign}, frame {arm.frame}, zeros {arm.zeros}")
