"""Faults of the inputs, distinguished before anything is computed from the inputs."""

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
    """Memory for the check of the next inputs."""

    stamp: Cell
    """Instant of the last step [s], always finite."""
    force_stamp: Cell
    """Instant of the last force estimate [s]."""
    robot: Report
    """The last plausible state."""
    sent: IntCell
    """Number of commands that the last state may not contain yet."""
    sent_stamp: Annotated[FloatArray, "S"]
    """(S,) their instants, oldest first [s]."""
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
    """Return the robot state to use, and the faults of the inputs; update the memory.

    An implausible state is replaced by the last plausible one, advanced by the last command. A state from before the
    last command, lost or late, is advanced by the commands that it cannot contain: the next command may differ from the
    last one by so much only. The returned state shares no memory with the inputs.

    Args:
        watch: memory, written to.
        inputs: of this step.
        command: (n,) last joint velocity command [rad/s].
        period: time for which that command was held [s].
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
        last, none = robot_of(watch.robot), np.full(len(qd_max), np.nan)
        q = last.q_commanded + command * period
        robot = replace(last, q_commanded=q, qd_commanded=command.copy(), tau_ext=none, wrench=None)
        watch.force_stamp[0] = min(watch.force_stamp[0], now)
    else:
        if robot.stamp <= before < now:
            robot = replace(robot, q_commanded=_advanced(robot, now, watch), qd_commanded=command.copy())
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
    """Say how old a state is [s], the likely cause, and the remedy."""
    if age < 0:
        return f"{-age:.3f} s in the future: use one clock for states and steps"
    return (
        f"{age:.3f} s old, because this machine is busy, perhaps without a real-time kernel, or the connection is slow:"
        " close other programs and check the connection to the arm"
    )


def _advanced(robot: RobotState, now: float, watch: Watched) -> FloatArray:
    """Return the commanded joint positions (n,) [rad] of an arm at `now`, after the commands since its report."""
    q, count = robot.q_commanded, watch.sent[0]
    for i, (start, command) in enumerate(zip(watch.sent_stamp[:count], watch.sent_command[:count], strict=True)):
        # the command before the first of them is unknown, and assumed to be the same
        begin = max(start, robot.stamp) if i else robot.stamp
        duration = (watch.sent_stamp[i + 1] if i + 1 < count else now) - begin
        if duration > 0:
            q = q + command * duration
    return q


def robot_of(report: Report) -> RobotState:
    """Return the robot state of a report in a record, as a copy."""
    stamp, q, qd, q_commanded, qd_commanded, tau_ext, wrench = (part.copy() for part in report)
    estimate = None if np.isnan(wrench[0]) else wrench
    return RobotState(float(stamp[0]), q, qd, q_commanded, qd_commanded, tau_ext, estimate)


def put_robot(report: Report, robot: RobotState) -> None:
    """Write an arm's state to a report in a record."""
    for name, part in report._asdict().items():
        number = getattr(robot, name)
        part[:] = np.nan if number is None else number


@compiled
def add_sent(watch: Watched, command: FloatArray) -> None:
    """Note the command of the last step; where there is no room left, the oldest is dropped."""
    count = watch.sent[0]
    if count == len(watch.sent_stamp):
        watch.sent_stamp[:-1], watch.sent_command[:-1] = watch.sent_stamp[1:].copy(), watch.sent_command[1:].copy()
        count -= 1
    watch.sent_stamp[count], watch.sent_command[count], watch.sent[0] = watch.stamp[0], command, count + 1


def begin_watch(watch: Watched, robot: RobotState) -> None:
    """Start the memory from a plausible state of the arm."""
    watch.stamp[0] = watch.force_stamp[0] = robot.stamp
    put_robot(watch.robot, robot)


def take_sent(watch: Watched, other: Watched) -> None:
    """Copy the sent commands of another record, as many of the newest as there is room for."""
    last = other.sent[0]
    count = watch.sent[0] = min(last, len(watch.sent_stamp))
    watch.sent_stamp[:count], watch.sent_command[:count] = (
        part[last - count : last] for part in (other.sent_stamp, other.sent_command)
    )


@kernel
def is_plausible(
    now: float, robot: Report, watch: Watched, command: FloatArray, qd_max: FloatArray, p: FailureParams
) -> bool:
    """Return whether `examine` would find no fault and change nothing; if so, update the memory as it does.

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
