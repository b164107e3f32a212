"""Which inputs to believe: faults of the inputs, distinguished before anything is computed from them."""

from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import compiled, kernel
from pretouch.modes import Event
from pretouch.params import FailureParams
from pretouch.records import Cell, IntCell
from pretouch.robot.kinematics import below
from pretouch.sound import FASTEST, STRONGEST, sound_robot, time_of
from pretouch.types import FloatArray, Inputs, Report, RobotState
from pretouch.values import LARGEST, LATEST


class Watched(NamedTuple):
    """What is remembered to judge the next inputs."""

    stamp: Cell
    """Instant of the last step [s], always finite."""
    force_stamp: Cell
    """When the robot last gave a force estimate [s]."""
    robot: Report
    """The last state that was believed."""
    sent: IntCell
    """How many commands the last state may not know yet."""
    sent_stamp: Annotated[FloatArray, "S"]
    """(S,) when they were sent, oldest first [s]."""
    sent_command: Annotated[FloatArray, "S", "n"]
    """(S, n) [rad/s]."""


def examine(
    watch: Watched,
    inputs: Inputs,
    command: FloatArray,
    period: float,
    qd_max: FloatArray,
    params: FailureParams,
    torques: bool = False,
) -> tuple[RobotState, dict[Event, str]]:
    """Return the robot state to go by, and the faults found; write what is to be remembered.

    In place of a state that cannot be believed stands the last one that could, moved on by the last command. One from
    before the last command, lost or late, is moved on by the commands it cannot know of: the next one may differ from
    the last one sent by so much only. What is returned shares no memory with the inputs.

    Args:
        watch: memory, written to.
        inputs: of this step.
        command: (n,) last joint velocity command [rad/s].
        period: time that command was held [s].
        qd_max: (n,) joint velocity limits [rad/s].
        params: time limits.
        torques: whether the torques of the external force are needed, rather than the force.
    """
    faults: dict[Event, str] = {}
    robot, wrong = sound_robot(inputs.robot, qd_max)
    stamp, before = time_of(inputs.stamp), float(watch.stamp[0])
    now = before if stamp is None else stamp
    if robot is None:
        faults[Event.UNUSABLE] = wrong
    elif stamp is None:
        faults[Event.UNUSABLE] = f"Inputs.stamp is {inputs.stamp!r}"
    elif abs(now - robot.stamp) > params.state_timeout_s:
        faults[Event.STATE_STALE] = _stale(now - robot.stamp)
    add_sent(watch, command)
    if now < before:
        faults[Event.TIME_BACKWARDS] = f"from {before:.3f} s to {now:.3f} s"
        watch.sent[0] = 0
    if robot is None or faults:
        last = robot_of(watch.robot)
        robot = replace(
            last, q_commanded=last.q_commanded + command * period, qd_commanded=command.copy(),
            tau_ext=np.full(len(last.q), np.nan), wrench=None,
        )  # fmt: skip
        watch.force_stamp[0] = min(watch.force_stamp[0], now)
    else:
        if robot.stamp <= before < now:
            robot = replace(robot, q_commanded=_moved_on(robot, now, watch), qd_commanded=command.copy())
        if robot.wrench is not None and not below(robot.wrench, params.force_max_n):
            robot = replace(robot, wrench=None)
        missing = not below(robot.tau_ext, STRONGEST) if torques else robot.wrench is None
        watch.force_stamp[0] = min(watch.force_stamp[0], now) if missing else now
        if now - before > params.overrun_s:
            faults[Event.OVERRUN] = f"{now - before:.3f} s"
        if now - watch.force_stamp[0] > params.force_timeout_s:
            faults[Event.NO_FORCE] = f"{now - watch.force_stamp[0]:.2f} s"
    watch.stamp[0] = now
    put_robot(watch.robot, robot)
    return robot, faults


def _stale(age: float) -> str:
    """Say how old a state is [s], why that may be, and what to do."""
    if age < 0:
        return f"{-age:.3f} s in the future: let one clock stamp states and steps"
    return (
        f"{age:.3f} s old, for this machine is busy, perhaps without a real-time kernel, or the connection is slow:"
        " close other programs and check the connection to the arm"
    )


def _moved_on(robot: RobotState, now: float, watch: Watched) -> FloatArray:
    """Commanded joint positions (n,) [rad] by now of an arm that was sent these commands after its report."""
    q, count = robot.q_commanded, watch.sent[0]
    for i, (start, command) in enumerate(zip(watch.sent_stamp[:count], watch.sent_command[:count], strict=True)):
        # what came before the first of them is not known, and taken to be the same
        begin = max(start, robot.stamp) if i else robot.stamp
        lasted = (watch.sent_stamp[i + 1] if i + 1 < count else now) - begin
        if lasted > 0:
            q = q + command * lasted
    return q


def robot_of(report: Report) -> RobotState:
    """Return the arm's state that a report in a record holds, as a copy."""
    stamp, q, qd, q_commanded, qd_commanded, tau_ext, wrench = (part.copy() for part in report)
    known = None if np.isnan(wrench[0]) else wrench
    return RobotState(float(stamp[0]), q, qd, q_commanded, qd_commanded, tau_ext, known)


def put_robot(report: Report, robot: RobotState) -> None:
    """Write an arm's state to a report in a record."""
    for name, part in report._asdict().items():
        number = getattr(robot, name)
        part[:] = np.nan if number is None else number


@compiled
def add_sent(watch: Watched, command: FloatArray) -> None:
    """Note that a command was sent at the last step; of more than there is room for the oldest is forgotten."""
    count = watch.sent[0]
    if count == len(watch.sent_stamp):
        watch.sent_stamp[:-1], watch.sent_command[:-1] = watch.sent_stamp[1:].copy(), watch.sent_command[1:].copy()
        count -= 1
    watch.sent_stamp[count], watch.sent_command[count], watch.sent[0] = watch.stamp[0], command, count + 1


def begin_watch(watch: Watched, robot: RobotState) -> None:
    """Begin with a state of the arm that is known to be good."""
    watch.stamp[0] = watch.force_stamp[0] = robot.stamp
    put_robot(watch.robot, robot)


def take_sent(watch: Watched, other: Watched) -> None:
    """Take the commands that another record says were sent, of those that there is no room for the newest."""
    last = other.sent[0]
    count = watch.sent[0] = min(last, len(watch.sent_stamp))
    watch.sent_stamp[:count], watch.sent_command[:count] = (
        part[last - count : last] for part in (other.sent_stamp, other.sent_command)
    )


@kernel
def believable(
    now: float, robot: Report, watch: Watched, command: FloatArray, qd_max: FloatArray, p: FailureParams
) -> bool:
    """Whether `examine` finds no fault and changes nothing but torques to NaN; then do what it does to the memory.

    `now` [s] is the instant of the step, `command` (n,) the last joint velocity command, `qd_max` (n,) its limits
    [rad/s].
    """
    stamp = robot.stamp[0]
    for j in range(len(qd_max)):
        for number in (robot.q[j], robot.qd[j], robot.q_commanded[j]):
            if not abs(number) < LARGEST.limit:
                return False
        if not abs(robot.qd_commanded[j]) < FASTEST * qd_max[j]:
            return False
    for number in robot.wrench:
        if not abs(number) < p.force_max_n:
            return False
    on_time = abs(now - stamp) <= p.state_timeout_s and 0.0 <= now - watch.stamp[0] <= p.overrun_s
    # a state from before the last command, or one without torques, is for `examine`
    newer = stamp > watch.stamp[0] or now == watch.stamp[0]
    if not (
        abs(now) < LATEST.limit and abs(stamp) < LATEST.limit and on_time and newer and below(robot.tau_ext, STRONGEST)
    ):
        return False
    add_sent(watch, command)
    watch.stamp[0] = watch.force_stamp[0] = now
    last = watch.robot
    last.stamp[0], last.q[:], last.qd[:], last.q_commanded[:] = stamp, robot.q, robot.qd, robot.q_commanded
    last.qd_commanded[:], last.tau_ext[:], last.wrench[:] = robot.qd_commanded, robot.tau_ext, robot.wrench
    return True
