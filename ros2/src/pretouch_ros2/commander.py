"""Commands of a commander over a topic, as the loop takes them: a wrong sender is named, and the arm holds."""

from itertools import zip_longest
from time import time as wall_clock
from typing import Any

import numpy as np

from pretouch import desired
from pretouch.desired import Desired
from pretouch.errors import RobotError
from pretouch.robot.model import RobotModel
from pretouch_ros2.messages import TRAJECTORY, TWIST
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import Command, check_topic, seconds
from pretouch_ros2.robot import SHARED_S, Ros2Robot
from pretouch_ros2.stamps import SourceStamps

_KINDS = {"twist": TWIST, "trajectory": TRAJECTORY}
TOPICS: dict[Command, str] = {"twist": "/pretouch/twist", "trajectory": "/pretouch/joint_trajectory"}
"""Default topic of each kind of request."""
_POINTS_MOST = 1000
_AHEAD_S = 1.0
"""How far ahead trajectories may begin [s]: MoveIt Servo leaves room for its latency."""
_SHOWN = 80
"""Letters of a name from elsewhere that are shown."""


class _UnfitError(Exception):
    """Reason why a message requests no motion, as a part of a sentence."""


class Ros2Commander:
    """Receives requested motions; called in the loop, it returns the newest. For `loop.Options(desired=...)`.

    Before the first request, and while two programs send requests, it refuses: the arm holds and says why.
    """

    def __init__(
        self, kind: Command, robot: Ros2Robot, model: RobotModel, node: Ros2Node, topic: str = "", base_frame: str = ""
    ) -> None:
        """Subscribe to a topic of requests.

        Args:
            kind: twist: geometry_msgs/TwistStamped; trajectory: the velocities of trajectory_msgs/JointTrajectory, as
                MoveIt Servo sends.
            robot: the arm.
            model: of the arm.
            node: subscribes to the topic.
            topic: '': the default in `TOPICS`.
            base_frame: further name of the base frame, beside the model's own.
        """
        self.topic = topic or TOPICS[kind]
        check_topic("Ros2Commander", "topic", self.topic)
        if self.topic == robot.params.command_topic:
            raise RobotError(f"{self.topic} is where the arm's commands go: ask on another topic.")
        self._robot, self.kind = robot, _KINDS[kind]
        self._base = (*_resting_links(model), *filter(None, [base_frame]))
        self._ee = model.links[model.ee]
        self._shared = robot.params.shared_clock
        self._stamps = SourceStamps(self._shared)
        self._newest: tuple[Desired, bool] | None = None
        self._source = node.subscribe(self.topic, self.kind, self._take)

    @property
    def announced(self) -> str:
        """Say what the arm will do, before it moves."""
        return (
            f"The arm follows the commands on {self.topic} ({self.kind.replace('/msg/', '/')}) anywhere within its"
            " reach and up to its joints' speed limits; without commands it holds. It keeps clear of what its units"
            " see, but not of floor, table or itself."
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the messages for a person, a sentence each."""
        return tuple(filter(None, (self._source.unreadable, self._stamps.not_newer(self.topic))))

    def __call__(self) -> Desired:
        """Return the motion that is requested now."""
        topic, newest = self.topic, self._newest
        if self._stamps.together():
            return desired.refused(0.0, f"several programs ask on {topic}: run only one")
        if old := self._stamps.not_newer(topic):
            return desired.refused(0.0, old.removesuffix("."))
        if newest is None:
            kind = self.kind.replace("/msg/", "/")
            return desired.refused(0.0, f"no {kind} was received on {topic} yet: start what publishes it")
        request, in_ee = newest
        if not in_ee:
            return request
        R = self._robot.orientation()
        with np.errstate(invalid="ignore"):  # the step names what is no number
            number = np.hstack([request.number[:, :3] @ R.T, request.number[:, 3:] @ R.T])
        return Desired(request.kind, request.stamp, number)

    def _take(self, message: Any, received: float, writer: int) -> None:
        instant = self._stamps.instant(message.header, received, writer)
        if instant is None:
            return
        try:
            self._check_clock()
            read = self._twist if self.kind == TWIST else self._trajectory
            self._newest = read(message, instant)
        except _UnfitError as unfit:
            self._newest = desired.refused(received, f"on {self.topic} {unfit}"), False

    def _check_clock(self) -> None:
        behind, ahead = self._stamps.behind, _AHEAD_S if self.kind == TRAJECTORY else SHARED_S
        if self._shared and behind is not None and not -ahead < behind < SHARED_S:
            raise _UnfitError(
                f"the stamps are {behind:.3g} s behind this machine's time of day: set the"
                " clocks by NTP, or say that ROS has its own clock"
            )

    def _twist(self, message: Any, instant: float) -> tuple[Desired, bool]:
        """Return what a message asks for, and whether that is in the end-effector's frame."""
        frame = message.header.frame_id
        if frame not in (*self._base, self._ee):
            frames = ", ".join((*self._base, self._ee))
            raise _UnfitError(f"twists are in the frame {frame[:_SHOWN]!r}: give one of {frames}")
        v, w = message.twist.linear, message.twist.angular
        return desired.twist(instant, (v.x, v.y, v.z), (w.x, w.y, w.z)), frame == self._ee

    def _trajectory(self, message: Any, instant: float) -> tuple[Desired, bool]:
        """Return the velocities of a trajectory's points, which may lie ahead; they are in no frame."""
        names, ours, points = tuple(message.joint_names), self._robot.joints, message.points
        other = next((pair for pair in zip_longest(ours, names, fillvalue="") if pair[0] != pair[1]), None)
        if other is not None:
            raise _UnfitError(
                f"the joint {other[1][:_SHOWN]!r} is in the place of {other[0]!r}: give"
                f" {', '.join(ours)}, in this order"
            )
        if not 0 < len(points) <= _POINTS_MOST:
            raise _UnfitError(f"a trajectory has {len(points)} points: give 1 to {_POINTS_MOST}")
        for point in points:
            if len(point.velocities) != len(ours):
                raise _UnfitError(
                    f"{len(point.velocities)} joint velocities are requested: give {len(ours)}, of {', '.join(ours)}"
                )
        stamp = seconds(message.header.stamp.sec, message.header.stamp.nanosec)
        ahead = max(stamp - wall_clock(), 0.0) if self._shared and stamp else 0.0
        times = [seconds(point.time_from_start.sec, point.time_from_start.nanosec) for point in points]
        velocities = np.array([point.velocities for point in points])
        return desired.joint_velocities(instant + ahead + np.array(times), velocities), False


def _resting_links(model: RobotModel) -> tuple[str, ...]:
    """Names of the links that are the base frame, whatever the joints do."""
    kin = model.kinematics(model.description.q_ready)
    here = [not p.any() and np.array_equal(R, np.eye(3)) for p, R in zip(kin.position, kin.rotation, strict=True)]
    return tuple(name for i, name in enumerate(model.links) if here[i] and not model.moved_by[i].any())
