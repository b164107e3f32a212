"""Which inputs to believe: faults of the inputs, distinguished before anything is computed from them."""

from dataclasses import replace
from typing import Annotated, NamedTuple

import numpy as np

from pretouch.compiled import kernel
from pretouch.desired import LARGEST, LATEST
from pretouch.modes import Event
from pretouch.params import FailureParams
from pretouch.records import Cell, Flat, IntCell
from pretouch.robot.kinematics import below
from pretouch.sound import FASTEST, STRONGEST, sound_robot, time_of
from pretouch.types import FloatArray, Inputs, RobotState
from pretouch.values import value


@value
class Watch:
    """What is remembered to judge the next inputs."""

    stamp: float
    """Instant of the last step [s], always finite."""
    robot: RobotState
    """The last state that was believed."""
    force_stamp: float
    """When the robot last gave a force estimate [s]."""
    sent: tuple[tuple[float, FloatArray], ...] = ()
    """Instants [s] and joint velocities (n,) [rad/s] of the commands that the last state may not know yet."""


class Belief(NamedTuple):
    """Which reports of an arm are believed."""

    qd_max: Annotated[FloatArray, "n"]
    """(n,) joint velocity limits [rad/s]."""
    state_timeout_s: float
    overrun_s: float
    force_max_n: float


class Report(NamedTuple):
    """As `RobotState`; a wrench of NaN is none."""

    stamp: Cell
    q: Annotated[FloatArray, "n"]
    qd: Annotated[FloatArray, "n"]
    q_commanded: Annotated[FloatArray, "n"]
    qd_commanded: Annotated[FloatArray, "n"]
    tau_ext: Annotated[FloatArray, "n"]
    wrench: Annotated[FloatArray, 6]


class Watched(NamedTuple):
    """What is remembered to judge the next inputs, see `faults.Watch`."""

    stamp: Cell
    force_stamp: Cell
    robot: Report
    sent: IntCell
    """How many commands the last state may not know yet."""
    sent_stamp: Annotated[FloatArray, "S"]
    """(S,) when they were sent, oldest first [s]."""
    sent_command: Annotated[FloatArray, "S", "n"]
    """(S, n) [rad/s]."""


def watch_init(robot: RobotState) -> Watch:
    """Begin with a state that is known to be good."""
    return Watch(robot.stamp, robot, robot.stamp)


def examine(
    watch: Watch,
    inputs: Inputs,
    command: FloatArray,
    period: float,
    qd_max: FloatArray,
    params: FailureParams,
    torques: bool = False,
) -> tuple[RobotState, dict[Event, str], Watch]:
    """Return the robot state to go by, the faults found, and what to remember.

    In place of a state that cannot be believed stands the last one that could, moved on by the last command. One from
    before the last command, lost or late, is moved on by the commands it cannot know of: the next one may differ from
    the last one sent by so much only. What is returned shares no memory with the inputs.

    Args:
        watch: memory.
        inputs: of this step.
        command: (n,) last joint velocity command [rad/s].
        period: time that command was held [s].
        qd_max: (n,) joint velocity limits [rad/s].
        params: time limits.
        torques: whether the torques of the external force are needed, rather than the force.
    """
    faults: dict[Event, str] = {}
    robot, wrong = sound_robot(inputs.robot, qd_max)
    stamp = time_of(inputs.stamp)
    now = watch.stamp if stamp is None else stamp
    if robot is None:
        faults[Event.UNUSABLE] = wrong
    elif stamp is None:
        faults[Event.UNUSABLE] = f"the step's time stamp is {inputs.stamp}"
    elif abs(now - robot.stamp) > params.state_timeout_s:
        faults[Event.STATE_STALE] = _stale(now - robot.stamp)
    sent = (*watch.sent[-int(params.state_timeout_s / period) - 1 :], (watch.stamp, command))
    if now < watch.stamp:
        faults[Event.TIME_BACKWARDS] = f"from {watch.stamp:.3f} s to {now:.3f} s"
        sent = ()
    if robot is None or faults:
        last = watch.robot
        believed = replace(
            last, q_commanded=last.q_commanded + command * period, qd_commanded=command,
            tau_ext=np.full(len(last.q), np.nan), wrench=None,
        )  # fmt: skip
        return believed, faults, Watch(now, believed, min(watch.force_stamp, now), sent)
    if robot.stamp <= watch.stamp < now:
        robot = replace(robot, q_commanded=_moved_on(robot, now, sent), qd_commanded=command)
    if robot.wrench is not None and not below(robot.wrench, params.force_max_n):
        robot = replace(robot, wrench=None)
    missing = not below(robot.tau_ext, STRONGEST) if torques else robot.wrench is None
    force_stamp = min(watch.force_stamp, now) if missing else now
    if now - watch.stamp > params.overrun_s:
        faults[Event.OVERRUN] = f"{now - watch.stamp:.3f} s"
    if now - force_stamp > params.force_timeout_s:
        faults[Event.NO_FORCE] = f"{now - force_stamp:.2f} s"
    return robot, faults, Watch(now, robot, force_stamp, sent)


def _stale(age: float) -> str:
    """Say how old a state is [s], why that may be, and what to do."""
    if age < 0:
        return f"{-age:.3f} s in the future: let one clock stamp states and steps"
    return (
        f"{age:.3f} s old, for this machine is busy, perhaps without a real-time kernel, or the connection is slow:"
        " close other programs and check the connection to the arm"
    )


def _moved_on(robot: RobotState, now: float, sent: tuple[tuple[float, FloatArray], ...]) -> FloatArray:
    """Commanded joint positions (n,) [rad] by now of an arm that was sent these commands after its report."""
    q, ends = robot.q_commanded, [start for start, _ in sent[1:]]
    for i, (end, (start, command)) in enumerate(zip([*ends, now], sent, strict=True)):
        # what came before the first of them is not known, and taken to be the same
        held = end - (max(start, robot.stamp) if i else robot.stamp)
        if held > 0:
            q = q + command * held
    return q


def watch_of(memory: Flat) -> Watch:
    """Return what a controller remembers to judge the next inputs."""
    count, stamps, commands = (memory.get(f"watch.{name}") for name in ("sent", "sent_stamp", "sent_command"))
    sent = zip(stamps[:count].tolist(), commands[:count], strict=True)
    return Watch(
        memory.get("watch.stamp"), robot_of(memory, "watch.robot"), memory.get("watch.force_stamp"), tuple(sent)
    )


def keep_watch(memory: Flat, watch: Watch) -> None:
    """Let a controller remember it: of the commands the newest."""
    most = len(memory.get("watch.sent_stamp"))
    sent = watch.sent[-most:]
    memory.put("watch.stamp", watch.stamp)
    memory.put("watch.force_stamp", watch.force_stamp)
    memory.put("watch.sent", len(sent))
    stamps, commands = memory.get("watch.sent_stamp"), memory.get("watch.sent_command")
    for k, (stamp, command) in enumerate(sent):
        stamps[k], commands[k] = stamp, command
    put_robot(memory, "watch.robot", watch.robot)


def robot_of(record: Flat, path: str) -> RobotState:
    """Return the arm's state that a `Report` in a record holds."""
    known = {name: record.get(f"{path}.{name}") for name in Report._fields}
    return RobotState(**known | ({"wrench": None} if np.isnan(known["wrench"][0]) else {}))


def put_robot(record: Flat, path: str, robot: RobotState) -> None:
    """Write an arm's state to a `Report` in a record."""
    for name in Report._fields:
        number = getattr(robot, name)
        record.put(f"{path}.{name}", np.nan if number is None else number)


@kernel
def believable(now: float, robot: Report, watch: Watched, command: FloatArray, p: Belief) -> bool:
    """Whether `examine` finds no fault and changes nothing but torques to NaN; then do what it does to the memory.

    `now` [s] is the instant of the step, `command` (n,) the last joint velocity command [rad/s].
    """
    stamp = robot.stamp[0]
    for j in range(len(p.qd_max)):
        for number in (robot.q[j], robot.qd[j], robot.q_commanded[j]):
            if not abs(number) < LARGEST:
                return False
        if not abs(robot.qd_commanded[j]) < FASTEST * p.qd_max[j]:
            return False
    for number in robot.wrench:
        if not abs(number) < p.force_max_n:
            return False
    on_time = abs(now - stamp) <= p.state_timeout_s and 0.0 <= now - watch.stamp[0] <= p.overrun_s
    # a state from before the last command, or one without torques, is for `examine`
    newer = stamp > watch.stamp[0] or now == watch.stamp[0]
    if not (abs(now) < LATEST and abs(stamp) < LATEST and on_time and newer and below(robot.tau_ext, STRONGEST)):
        return False
    count = watch.sent[0]
    if count == len(watch.sent_stamp):
        watch.sent_stamp[:-1], watch.sent_command[:-1] = watch.sent_stamp[1:].copy(), watch.sent_command[1:].copy()
        count -= 1
    watch.sent_stamp[count], watch.sent_command[count], watch.sent[0] = watch.stamp[0], command, count + 1
    watch.stamp[0] = watch.force_stamp[0] = now
    last = watch.robot
    last.stamp[0], last.q[:], last.qd[:], last.q_commanded[:] = stamp, robot.q, robot.qd, robot.q_commanded
    last.qd_commanded[:], last.tau_ext[:], last.wrench[:] = robot.qd_commanded, robot.tau_ext, robot.wrench
    return True
