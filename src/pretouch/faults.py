"""Which inputs to believe: faults in the robot's state, told apart before anything is computed from them."""

import math
from dataclasses import dataclass, replace

import numpy as np

from pretouch.modes import Event
from pretouch.params import FailureParams
from pretouch.types import FloatArray, Inputs, RobotState


@dataclass(frozen=True, slots=True)
class Watch:
    """What is remembered to judge the next inputs."""

    stamp: float
    """Instant of the last step [s], always finite."""
    robot: RobotState
    """The last state that was believed."""
    force_stamp: float
    """When the robot last gave a force estimate [s]."""


def watch_init(robot: RobotState) -> Watch:
    """Begin with a state that is known to be good."""
    return Watch(robot.stamp, robot, robot.stamp)


def examine(
    watch: Watch, inputs: Inputs, command: FloatArray, period: float, params: FailureParams
) -> tuple[RobotState, dict[Event, str], Watch]:
    """Return the robot state to go by, the faults found, and what to remember.

    In place of a state that cannot be believed stands the last one that could, moved on by the last command.

    Args:
        watch: memory.
        inputs: of this step.
        command: (n,) last joint velocity command [rad/s].
        period: time that command was held [s].
        params: time limits.
    """
    robot = inputs.robot
    faults: dict[Event, str] = {}
    wrong = not_finite(robot) if math.isfinite(inputs.stamp) else "time stamps"
    if wrong:
        faults[Event.NOT_FINITE] = wrong
    else:
        if inputs.stamp < watch.stamp:
            faults[Event.TIME_BACKWARDS] = f"from {watch.stamp:.3f} s to {inputs.stamp:.3f} s"
        age = inputs.stamp - robot.stamp
        if abs(age) > params.state_timeout_s:
            faults[Event.STATE_STALE] = f"{age:.3f} s"
    stamp = inputs.stamp if math.isfinite(inputs.stamp) else watch.stamp
    if faults:
        last = watch.robot
        believed = replace(last, q_commanded=last.q_commanded + command * period, qd_commanded=command, wrench=None)
        return believed, faults, Watch(stamp, believed, min(watch.force_stamp, stamp))
    # a comparison with NaN is false, so numbers that are not finite are refused too
    if robot.wrench is not None and not (np.abs(robot.wrench) < params.force_max_n).all():
        robot = replace(robot, wrench=None)
    force_stamp = min(watch.force_stamp, stamp) if robot.wrench is None else stamp
    if stamp - watch.stamp > params.overrun_s:
        faults[Event.OVERRUN] = f"{stamp - watch.stamp:.3f} s"
    if stamp - force_stamp > params.force_timeout_s:
        faults[Event.NO_FORCE] = f"{stamp - force_stamp:.2f} s"
    return robot, faults, Watch(stamp, robot, force_stamp)


def not_finite(robot: RobotState) -> str:
    """Name the first part of a robot's state that is not finite, or ''."""
    parts = {
        "time stamps": np.array(robot.stamp),
        "joint positions": robot.q,
        "joint velocities": robot.qd,
        "commanded joint positions": robot.q_commanded,
        "commanded joint velocities": robot.qd_commanded,
    }
    return next((name for name, value in parts.items() if not np.isfinite(value).all()), "")
