"""The only clock of the package, and the loop that turns the controller: read, step, command, record."""

import time
from collections.abc import Callable

import numpy as np

from pretouch.control.joint_box import brake, joint_box
from pretouch.controller import Controller
from pretouch.ports import Clock, Recorder, Robot, Skin
from pretouch.types import ControlStep, FloatArray, Inputs

_REST_CYCLES = 100
"""Cycles within which any arm comes to rest: a Panda's slowest joint needs 0.29 s, 29 cycles at 100 Hz."""


class MonotonicClock:
    """The machine's monotonic clock, ticking at a fixed period. A late caller gets the next tick, not a burst."""

    def __init__(self, period: float) -> None:
        """Take the period [s]."""
        self.period = period
        self.missed = 0
        """Ticks that went by unused because the caller was late."""
        self._next = time.monotonic()

    def tick(self) -> float:
        """Wait for the next tick and return the time [s]."""
        now = time.monotonic()
        late = int((now - self._next) / self.period)
        if late > 0:
            self.missed += late
            self._next += late * self.period
        if self._next > now:
            time.sleep(self._next - now)
        self._next += self.period
        return time.monotonic()


def run(
    controller: Controller,
    robot: Robot,
    skin: Skin,
    clock: Clock,
    recorder: Recorder,
    done: Callable[[ControlStep], bool],
    resume: Callable[[], bool] = lambda: False,
) -> None:
    """Turn the controller until `done` says so of a step. However it ends, the arm is first brought to rest.

    `resume` says whether a person now asks to leave a latched HOLD.
    """
    state = controller.init(robot.read())
    sent = state.command
    try:
        while True:
            now = clock.tick()
            step, state = controller.step(state, Inputs(now, robot.read(), skin.read(), resume()))
            robot.command(step.command)
            sent = step.command
            recorder.record(step)
            if done(step):
                return
    finally:
        come_to_rest(controller, robot, clock, state.watch.robot.q_commanded, sent)


def come_to_rest(controller: Controller, robot: Robot, clock: Clock, q: FloatArray, qd: FloatArray) -> None:
    """Command the arm from its last command to rest, within its limits.

    Where the arm is by then is reckoned from the commands: the robot's state may be what ended the loop.

    Args:
        controller: for the limits and the period.
        robot: to command.
        clock: one tick for each command.
        q: (n,) joint positions the motion generator was last known to be at [rad].
        qd: (n,) joint velocities sent last [rad/s].
    """
    period = controller.limits.period
    for _ in range(_REST_CYCLES):
        if not np.any(qd):
            return
        clock.tick()
        q = q + qd * period
        qd = brake(qd, *joint_box(q, qd, controller.limits), controller.limits)
        robot.command(qd)
