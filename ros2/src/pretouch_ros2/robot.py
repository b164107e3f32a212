"""The port `Arm` over ROS 2 topics: joint states, wrench and external torques in, commands out."""

import math
from time import monotonic, sleep
from typing import Self

import numpy as np

from pretouch.errors import RobotError
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, RobotState
from pretouch_ros2.inputs import JointReading, Joints, TorqueEstimate, Wrench
from pretouch_ros2.messages import JOINT_STATE, TRAJECTORY, WRENCH
from pretouch_ros2.node import Ros2Node
from pretouch_ros2.params import ArmParams
from pretouch_ros2.stamps import SourceStamps
from pretouch_ros2.trajectory_commands import TrajectoryCommands

_PERIOD_S = 0.01
SHARED_S = 0.05
"""How far the stamps of a clock that is shared may be from the time of day [s]."""


class Ros2Robot:
    """An arm behind topics. `wait` for it before it is used; for one thread, as the control loop's.

    A state is stamped with when it was measured, by this machine's monotonic clock. The arm reports no commanded
    positions and velocities: they are reckoned from the trajectories that it was sent.
    """

    def __init__(self, params: ArmParams, model: RobotModel, node: Ros2Node, period: float = _PERIOD_S) -> None:
        """Take the settings, the arm, the node, and the control period [s]."""
        if params.joint_names and len(params.joint_names) != model.n:
            raise RobotError(
                f"joint_names has {len(params.joint_names)} names, but {model.description.name} has {model.n} joints:"
                f" give one for each of {', '.join(model.joints)}."
            )
        if params.hold_s < period:
            raise RobotError(f"hold_s is {params.hold_s:g} s: give at least the control period, {period:g} s.")
        self.params, self._node, self._model = params, node, model
        self._joints = Joints(params.joint_names or model.joints, SourceStamps(params.shared_clock))
        self._wrench = Wrench(params, SourceStamps(params.shared_clock))
        self._states = node.subscribe(params.joint_states, JOINT_STATE, self._joints.take)
        self._wrenches = node.subscribe(params.wrench, WRENCH, self._wrench.take)
        self._torques = TorqueEstimate(params, self._joints.names, SourceStamps(params.shared_clock))
        self._efforts = [node.subscribe(params.torques, JOINT_STATE, self._torques.take)] if params.torques else []
        stamps = self._joints.stamps, self._wrench.stamps, self._torques.stamps
        self._stamps = tuple(zip((params.joint_states, params.wrench, params.torques), stamps, strict=True))
        self._commands = TrajectoryCommands(params, model, self._joints.names, node, period)
        self._tick = self._tick_before = -math.inf
        self._lost, self._ended = "", False
        self.name = "arm on ROS 2"

    def wait(self, timeout: float = 5.0) -> None:
        """Wait until all inputs come and nobody else commands the controller, for so long at most [s].

        What is not so by then is a RobotError that says what there is instead.
        """
        if not self._node.wait_for(lambda: not (self._missing_input() or self._conflict()), timeout):
            raise RobotError(self._conflict() or self._missing_input())
        self._check_clock()

    @property
    def notes(self) -> tuple[str, ...]:
        """Remarks on the messages for a person, a sentence each."""
        p, sentences = self.params, [self._wrench.warning]
        sentences += [stamps.not_newer(topic) for topic, stamps in self._stamps]
        sentences += [source.unreadable for source in (self._states, self._wrenches, *self._efforts)]
        if self._joints.differentiated:
            sentences.append(f"{p.joint_states} has no velocities: they are computed from the positions.")
        if p.shared_clock and self._joints.newest is not None and self._joints.stamps.behind is None:
            sentences.append(f"{p.joint_states} has no stamps: whether its clock is this machine's cannot be checked.")
        if self._commands.publisher.subscribers > 1:
            sentences.append(f"{p.command_topic} has {self._commands.publisher.subscribers} subscribers.")
        if not p.shared_clock:
            sentences.append("Without a shared clock only joint_trajectory_controller 4.17 to 4.20 moves smoothly.")
        return tuple(filter(None, sentences))

    def unfit(self) -> tuple[str, ...]:
        """Return nothing: no topic says what the arm has against being moved."""
        return ()

    def begin(self) -> None:
        """Begin at rest where the arm is, and wait until it has settled there; RobotError where that is not known."""
        self._check_sound()
        self._ended = False
        if not self._commands.begun:
            sleep(self._commands.begin(self.measured(), monotonic()))

    def read(self) -> RobotState:
        """Return the newest state; an arm that does not follow its commands is a RobotError, once."""
        now = monotonic()
        self._tick_before, self._tick = self._tick, now
        joints = self.measured()
        if not self._lost:
            try:
                self._check_sound()
                self._commands.check(joints, now)
            except RobotError as error:
                self._lost = str(error)
                raise
        # a state of this turn, measured before the last command, is not moved on by the controller
        q, qd = self._commands.at(joints, now if joints.stamp > self._tick_before else joints.stamp)
        R_O_ee = np.eye(3) if self.params.frame == "base" else self.orientation()
        wrench = self._wrench.read(now, R_O_ee)
        return RobotState(joints.stamp, joints.q, joints.qd, q, qd, self._torques.read(now), wrench)

    def command(self, qd: FloatArray) -> None:
        """Take joint velocities (n,) [rad/s] as the set-point, kept for `hold_s` unless there is another one.

        Before the arm has settled it stays at rest. Once `read` has said that something is wrong, commands are that
        RobotError too: the arm is at rest when the last trajectory has ended.
        """
        if self._lost or self._ended:
            raise RobotError(self._lost or "The arm takes no commands any more: begin first.")
        if not np.isfinite(qd).all():
            raise RobotError(f"The command is {qd}: give finite joint velocities.")
        now = self._tick if self._tick > -math.inf else monotonic()
        if not self._commands.begun:
            self._commands.begin(self.measured(), now)
        self._commands.send(qd, now)
        self._tick = -math.inf

    def end(self) -> None:
        """Command rest, wait until the last trajectory has ended, and take no more commands."""
        if not self._commands.begun or self._ended:
            return
        try:
            self.command(np.zeros(self._model.n))
        finally:
            self._ended = True
            self._wait_for_rest()

    def report(self) -> str:
        """Return '': topics have nothing to say."""
        return ""

    def _wait_for_rest(self) -> None:
        sleep(max(self._commands.ends - monotonic(), 0.0))

    @property
    def joints(self) -> tuple[str, ...]:
        """The arm's joints as the messages call them."""
        return self._joints.names

    def measured(self) -> JointReading:
        """Return the newest joint state; a RobotError where there is none."""
        if self._joints.newest is None:
            raise RobotError(self._missing_input())
        return self._joints.newest

    def orientation(self) -> FloatArray:
        """R_O_ee (3, 3) by the newest joint state; the identity where that has no numbers, which the step names."""
        q = self.measured().q
        return self._model.kinematics(q).rotation[self._model.ee] if np.isfinite(q).all() else np.eye(3)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Wait until the last trajectory has ended, at rest."""
        self._wait_for_rest()

    def _check_sound(self) -> None:
        wrong = self._node.failure or self._conflict()
        if wrong:
            raise RobotError(wrong)

    def _conflict(self) -> str:
        """Say whom this program shares the arm with, or ''."""
        p = self.params
        if self._node.others(self._commands.publisher):
            return (
                f"Another program publishes on {p.command_topic}: only one program may command the arm, so end it, or"
                " wait 10 s if it was killed."
            )
        for topic, stamps in self._stamps:
            if stamps.together():
                return f"Several publishers send on {topic}: run only one, or give each its own topic."
        return ""

    def _check_clock(self) -> None:
        """Refuse a clock that is not shared: trajectories would begin at another time than meant."""
        p, behind = self.params, self._joints.stamps.behind
        if p.shared_clock and behind is not None and abs(behind) > SHARED_S:
            raise RobotError(
                f"The stamps of {p.joint_states} are {behind:.3g} s behind this machine's time of day: set the clocks"
                " by NTP, or set shared_clock = false."
            )

    def _missing_input(self) -> str:
        """Say what has not come, and what there is; '' if nothing is missing."""
        p, joints = self.params, self._joints
        if joints.newest is None:
            if joints.unequal:
                return f"{p.joint_states} {joints.unequal}: publish as many, or set joint_states to another topic."
            if not joints.others:
                return _no_publisher(p.joint_states, JOINT_STATE, "joint_states", self._node.topics(JOINT_STATE))
            return (
                f"{p.joint_states} has no {', '.join(joints.missing) or 'message with all joints'}: set joint_names to"
                f" the arm's joints out of {', '.join(sorted(joints.others))}."
            )
        if not self._wrench.received_any:
            return _no_publisher(p.wrench, WRENCH, "wrench", self._node.topics(WRENCH))
        if p.torques and not self._torques.received_any:
            if not self._torques.others:
                return _no_publisher(p.torques, JOINT_STATE, "torques", self._node.topics(JOINT_STATE))
            return f"{p.torques} has efforts of {', '.join(self._torques.others)}, not of {', '.join(joints.names)}."
        if self._commands.publisher.subscribers:
            return ""
        there = self._node.topics(TRAJECTORY, subscribed=True)
        return (
            f"Nothing subscribes to {p.command_topic} (trajectory_msgs/JointTrajectory): activate the controller, or"
            f" set command_topic to one of {', '.join(there) or 'the topics that exist (none yet)'}."
        )


def _no_publisher(topic: str, kind: str, setting: str, there: tuple[str, ...]) -> str:
    choices = ", ".join(there) or "the topics that exist (none yet)"
    return (
        f"Nothing was received on {topic}: start its publisher, in the same domain and network, or set {setting} to one"
        f" of {choices} ({kind.replace('/msg/', '/')})."
    )
