"""The port `Robot` over ROS 2 topics: joint states and wrench in, commands out."""

import math
from time import monotonic, sleep, time
from typing import Self

import numpy as np

from pretouch.errors import RobotError
from pretouch.hardware.ros2.joints import Joints, Measured
from pretouch.hardware.ros2.messages import JOINT_STATE, TRAJECTORY, VELOCITIES, WRENCH
from pretouch.hardware.ros2.node import Ros2Node
from pretouch.hardware.ros2.params import ArmParams, parts
from pretouch.hardware.ros2.stamps import Stamps
from pretouch.hardware.ros2.trajectory import Motion, Reference
from pretouch.hardware.ros2.wrench import Wrench
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, RobotState

_PERIOD_S = 0.01
_FRESH_S = 0.1
"""Age of a joint state up to which it tells whether the arm follows [s]."""


class Ros2Robot:
    """An arm behind topics. `wait` for it before it is used; for one thread, as the control loop's.

    A state is stamped with when it was received, by this machine's monotonic clock. The arm reports no commanded
    positions and velocities: with trajectories they are reckoned from what it was sent, with velocities they are the
    measured positions and the last command.
    """

    def __init__(self, params: ArmParams, model: RobotModel, node: Ros2Node, period: float = _PERIOD_S) -> None:
        """Take the settings, the arm, the node, and the control period [s]."""
        if params.joint_names and len(params.joint_names) != model.n:
            raise RobotError(
                f"joint_names has {len(params.joint_names)} names, and {model.description.name} has {model.n} joints:"
                f" give one for each of {', '.join(model.joints)}."
            )
        if params.hold_s < period:
            raise RobotError(f"hold_s is {params.hold_s:g} s: give at least the control period, {period:g} s.")
        self.params, self._node = params, node
        self._model = RobotModel(model.description)  # memory of its own
        self._names = params.joint_names or model.joints
        self._joints = Joints(self._names, Stamps(params.shared_clock))
        self._wrench = Wrench(params, Stamps(params.shared_clock))
        self._states = node.subscribe(params.joint_states, JOINT_STATE, self._joints.take)
        self._wrenches = node.subscribe(params.wrench, WRENCH, self._wrench.take)
        kind = TRAJECTORY if params.command == "trajectory" else VELOCITIES
        self._commands = node.publisher(params.commands_on, kind)
        self._reference = Reference(model.description.qdd_max, period, params.hold_s)
        self._sent = np.zeros(model.n)
        self._settled = -math.inf
        self._turn = self._turn_before = -math.inf

    def wait(self, timeout: float = 5.0) -> None:
        """Wait until states and a wrench come and somebody takes commands, for so long at most [s].

        What has not come by then is a RobotError that says what there is instead.
        """

        def ready() -> bool:
            return self._joints.newest is not None and self._wrench.heard and self._commands.subscribers > 0

        if not self._node.wait_for(ready, timeout):
            raise RobotError(self._absent())

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know of what came, a sentence each."""
        found = [self._wrench.doubt, self._states.unreadable, self._wrenches.unreadable]
        if self._joints.differentiated:
            found.append(f"{self.params.joint_states} has no velocities: they are taken from the positions.")
        if self._states.publishers > 1:
            found.append(f"{self.params.joint_states} has {self._states.publishers} publishers.")
        if self._commands.subscribers > 1:
            found.append(f"{self.params.commands_on} has {self._commands.subscribers} subscribers.")
        return tuple(filter(None, found))

    def read(self) -> RobotState:
        """Return the newest state; an arm that does not follow its commands is a RobotError."""
        now = monotonic()
        self._turn_before, self._turn = self._turn, now
        joints = self._joints.newest
        if joints is None:
            raise RobotError(self._absent())
        q_commanded, qd_commanded = self._commanded(joints, now)
        wrench = self._wrench.read(now, self._orientation(joints.q))
        no_torques = np.full(self._model.n, np.nan)
        return RobotState(joints.stamp, joints.q, joints.qd, q_commanded, qd_commanded, no_torques, wrench)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point, kept for `hold_s` unless there is another one."""
        if not np.isfinite(qd).all():
            raise RobotError(f"The command holds {qd}: give finite joint velocities.")
        if self.params.command == "velocities":
            layout = self._node.messages.make("std_msgs/msg/MultiArrayLayout", [], 0)
            self._commands.publish(self._node.messages.make(VELOCITIES, layout, np.array(qd, dtype=np.float64)))
        else:
            self._continue(qd)
        self._sent, self._turn = np.array(qd, dtype=np.float64), -math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the arm once the last trajectory has ended, at rest; behind velocities a time-out does that."""
        sleep(max(self._reference.ends - monotonic(), 0.0))

    def _continue(self, qd: FloatArray) -> None:
        """Send the next trajectory; it begins with this turn of the loop, or at once if nothing was read for it."""
        now = self._turn if self._turn > -math.inf else monotonic()
        if not self._reference.begun:
            if self._joints.newest is None:
                raise RobotError(self._absent())
            self._settled = now + self.params.settle_s
            self._publish(self._reference.begin(self._joints.newest.q, now, self.params.settle_s), now)
        if now < self._settled and not np.any(qd):
            return
        self._settled = -math.inf
        self._publish(self._reference.command(qd, now), now)

    def _publish(self, course: Motion, began: float) -> None:
        make = self._node.messages.make
        nothing = np.zeros(0)
        points = [
            make("trajectory_msgs/msg/JointTrajectoryPoint", q, v, nothing, nothing,
                 make("builtin_interfaces/msg/Duration", *parts(float(t))))
            for t, q, v in course.way_points()
        ]  # fmt: skip
        # a stamp of zero means at once
        begin = parts(time() - (monotonic() - began)) if self.params.shared_clock else (0, 0)
        self._commands.publish(make(TRAJECTORY, self._node.messages.header(begin, ""), list(self._names), points))

    def _commanded(self, joints: Measured, now: float) -> tuple[FloatArray, FloatArray]:
        """Commanded positions and velocities (n,) at the state's instant.

        A state that came in this turn of the loop, but before the last command, is not moved on by the controller: it
        is given what is commanded by now.
        """
        if self.params.command == "velocities" or not self._reference.begun:
            return joints.q, self._sent
        if now - joints.stamp < _FRESH_S:
            self._check_following(joints)
        return self._reference.at(now if joints.stamp > self._turn_before else joints.stamp)

    def _orientation(self, q: FloatArray) -> FloatArray:
        """Orientation of the end-effector (3, 3), if the wrench needs it."""
        if self.params.frame == "base" or not np.isfinite(q).all():
            return np.eye(3)
        return self._model.kinematics(q).rotation[self._model.ee]

    def _check_following(self, joints: Measured) -> None:
        wanted, _ = self._reference.motion_at(joints.stamp)
        apart = np.abs(wanted - joints.q)
        worst = int(np.argmax(apart))
        if apart[worst] > self.params.follow_most_rad:
            raise RobotError(
                f"The arm does not follow: {self._names[worst]} is at {joints.q[worst]:.3f} rad and was sent to"
                f" {wanted[worst]:.3f} rad: see that its controller runs, then start again from where it stands."
            )

    def _absent(self) -> str:
        """Say what has not come, and what there is."""
        p, joints = self.params, self._joints
        if joints.newest is None:
            if not joints.others:
                return _nobody(p.joint_states, JOINT_STATE, "joint_states", self._node.topics(JOINT_STATE))
            return (
                f"{p.joint_states} has no {', '.join(joints.missing) or 'message with all joints'}: set joint_names to"
                f" the arm's joints out of {', '.join(sorted(joints.others))}."
            )
        if not self._wrench.heard:
            return _nobody(p.wrench, WRENCH, "wrench", self._node.topics(WRENCH))
        kind = TRAJECTORY if p.command == "trajectory" else VELOCITIES
        there = self._node.topics(kind, subscribed=True)
        return (
            f"Nobody takes {kind.replace('/msg/', '/')} on {p.commands_on}: activate the controller, or set"
            f" command_topic to one of {', '.join(there) or 'those there are (none yet)'}."
        )


def _nobody(topic: str, kind: str, setting: str, there: tuple[str, ...]) -> str:
    known = ", ".join(there) or "those there are (none yet)"
    return (
        f"Nothing came on {topic}: start what publishes it, in the same domain and network, or set {setting} to one of"
        f" {known} ({kind.replace('/msg/', '/')})."
    )
