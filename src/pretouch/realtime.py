"""The loop at 1 kHz on Linux: compiled before the start, without garbage collection, with priority and a processor."""

import ctypes
import gc
import math
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from pretouch import loop
from pretouch.controller import Controller
from pretouch.desired import joint_positions
from pretouch.errors import ParameterError
from pretouch.ports import Robot, SkinPort
from pretouch.signals import ended_in_order
from pretouch.types import ControlStep, FloatArray, Inputs, RangeReadings, RangeStatus, RobotState, SeenPoints

_PR_SET_TIMERSLACK, _PR_GET_TIMERSLACK = 29, 30
"""Options of Linux' `prctl`."""

_WARM_UP_STEPS = 3
"""Steps of each kind: the first one changes the memory that the next one uses."""
_PUSH_NM = 50.0
"""External torque of each joint in the rehearsed contact [Nm]."""
_NEWS_S = 0.5
"""Longest wait for a new state [s]; after it the controller reports the age of the newest one."""
_LOOK_S = 0.001
"""Period of the checks for a new state [s]."""


@dataclass(frozen=True)
class RealTimeOptions(loop.Options):
    """Optional inputs and settings of a loop in real time."""

    priority: int | None = None
    """See `real_time`."""
    cpu: int | None = None
    """See `real_time`."""
    tell: Callable[[str], None] = print
    """Receives a sentence for each setting that the machine refuses, before the loop begins."""


NO_OPTIONS = RealTimeOptions()


def run(
    controller: Controller, robot: Robot, skin: SkinPort, clock: loop.MonotonicClock, recorder: loop.Recorder,
    done: Callable[[ControlStep], bool], options: RealTimeOptions = NO_OPTIONS,
) -> None:  # fmt: skip
    """Run `loop.run`, warmed up and in a process prepared for real time; `clock.timing()` is the report.

    SIGTERM and SIGHUP, without another handler, end it like Ctrl-C: the arm comes to rest first.

    Args:
        controller: its period must be the clock's.
        robot: the arm.
        skin: its sensor units.
        clock: gives the ticks and measures the timing.
        recorder: records the cycles; it runs in the loop, so it must not wait for a disk.
        done: whether a step was the last.
        options: optional inputs and settings.
    """
    if not math.isclose(clock.period, controller.limits.period, rel_tol=1e-9):
        raise ParameterError(
            f"The clock has a period of {clock.period!r} s, the controller {controller.limits.period!r} s:"
            " make them the same (params.at_rate makes a profile for another rate)."
        )
    warm_up(controller, robot.read(), options.points is not None)
    with ended_in_order(), real_time(options.priority, options.cpu) as missing:
        for sentence in missing:
            options.tell(sentence)
        _await_news(robot)
        loop.run(controller, robot, skin, clock, recorder, done, options)


def _await_news(robot: Robot) -> None:
    """Wait for a state that is measured from now on.

    The preparation blocks other threads, as one that receives the arm's states: with the newest state from before, the
    first step would find the arm silent.
    """
    looks = loop.MonotonicClock(_LOOK_S)
    now = begun = looks.tick()
    while not robot.read().stamp >= begun and now < begun + _NEWS_S:
        now = looks.tick()


@contextmanager
def real_time(priority: int | None = None, cpu: int | None = None) -> Iterator[tuple[str, ...]]:
    """Prepare this process for a loop in real time, and undo that afterwards.

    The garbage collector is off, and the objects that exist are frozen: a full collection stops a loop for a tenth of a
    second. Timers of this thread wake without slack. Settings that the machine refuses are left out.

    Args:
        priority: of the thread in the scheduling class SCHED_FIFO, 1 to 99; None leaves the class as it is.
        cpu: number of the processor to stay on; None leaves that to the system.

    Yields:
        A sentence for each setting that the machine refuses.
    """
    check_wishes(priority, cpu)
    with ExitStack() as undo:
        undo.enter_context(_no_collections())
        _sharpen_timers(undo)
        yield tuple(filter(None, (_go_first(priority, undo), _stay(cpu, undo))))


def check_wishes(priority: int | None, cpu: int | None) -> None:
    """Raise ParameterError, with the choices, for a priority or processor that does not exist."""
    low, high = os.sched_get_priority_min(os.SCHED_FIFO), os.sched_get_priority_max(os.SCHED_FIFO)
    if priority is not None and not low <= priority <= high:
        raise ParameterError(f"The real-time priority is {priority}: give {low} to {high}.")
    allowed = sorted(os.sched_getaffinity(0))
    if cpu is not None and cpu not in allowed:
        raise ParameterError(
            f"Processor {cpu} is not available to this process: choose from {', '.join(map(str, allowed))}."
        )


@contextmanager
def _no_collections() -> Iterator[None]:
    was_on, froze = gc.isenabled(), gc.get_freeze_count() == 0
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        if froze:  # objects frozen by other code stay so
            gc.unfreeze()
        if was_on:
            gc.enable()


def _sharpen_timers(undo: ExitStack) -> None:
    """Remove the 50 us of slack that Linux gives the timers of ordinary threads."""
    prctl = ctypes.CDLL(None).prctl
    before = prctl(_PR_GET_TIMERSLACK, 0, 0, 0, 0)
    # a thread with real-time priority has none already
    if before > 0 and prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) == 0:
        undo.callback(prctl, _PR_SET_TIMERSLACK, before, 0, 0, 0)


def _go_first(priority: int | None, undo: ExitStack) -> str:
    if priority is None:
        return ""
    policy, param = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except PermissionError:
        return (
            f"Real-time priority {priority} was refused, so the loop runs at ordinary priority: add the line"
            " 'USER - rtprio 99' with your user's name to /etc/security/limits.conf and log in again, or run with"
            " CAP_SYS_NICE."
        )
    except OSError as error:
        return f"Real-time priority {priority} is not available here ({error.strerror}): the loop runs without it."
    undo.callback(os.sched_setscheduler, 0, policy, param)
    return ""


def _stay(cpu: int | None, undo: ExitStack) -> str:
    if cpu is None:
        return ""
    before = os.sched_getaffinity(0)
    try:
        os.sched_setaffinity(0, {cpu})
    except OSError as error:
        return (
            f"Staying on processor {cpu} was refused ({error.strerror}), so the loop may move: add it to the container"
            " or cpuset of this process."
        )
    undo.callback(os.sched_setaffinity, 0, before)
    return ""


def warm_up(controller: Controller, robot: RobotState, points: bool = False) -> None:
    """Run steps without using their results, so that nothing is compiled or loaded in the loop.

    The steps have obstacles and none, follow the path and a commander, detect a contact and an implausible robot state:
    TRACK, REACT and HOLD. The controller and its arm do not change.

    Args:
        controller: of the loop.
        robot: a state of the arm, from its interface.
        points: whether the loop has an outside source of points.
    """
    quiet, push = np.zeros(6), np.array([0.9 * controller.profile.failure.force_max_n, 0, 0, 0, 0, 0])
    lost = np.full(len(robot.q), np.nan)
    for status in (RangeStatus.SIGNAL, RangeStatus.OK):
        rehearsal = _Rehearsal(controller, robot, points)
        for _ in range(controller.profile.window.samples):
            rehearsal.step(None, quiet)
        for wrench in (robot.wrench, None, quiet, push):
            for _ in range(_WARM_UP_STEPS):
                rehearsal.step(status, wrench, _PUSH_NM if wrench is push else 0.0)
        for _ in range(_WARM_UP_STEPS):
            rehearsal.step(status, quiet, commanded=True)
        # a fault that latches, and the resume after it
        rehearsal.step(status, quiet, q=lost)
        rehearsal.step(status, quiet, resume=True)


class _Rehearsal:
    """Runs a controller with artificial inputs, one period after another."""

    def __init__(self, controller: Controller, robot: RobotState, points: bool) -> None:
        self._controller, self._robot, self._now, self._points = controller, robot, robot.stamp, points
        self._state = controller.init(robot)

    def step(
        self, range_status: RangeStatus | None, wrench: FloatArray | None, torque: float = 0.0,
        q: FloatArray | None = None, resume: bool = False, commanded: bool = False,
    ) -> None:  # fmt: skip
        """Run one step. All units report this status, at distances up to 1 m; None stands for no report.

        `torque` is added to the reported torque of each joint [Nm]: a detector may use torques alone.
        """
        self._now += self._controller.limits.period
        units = len(self._controller.skin)
        stamp = np.full(units, -np.inf if range_status is None else self._now)
        status = np.full(units, int(RangeStatus.NONE if range_status is None else range_status))
        robot = replace(self._robot, stamp=self._now, wrench=wrench, q=self._robot.q if q is None else q)
        if torque and robot.tau_ext is not None:
            robot = replace(robot, tau_ext=robot.tau_ext + torque)
        readings = RangeReadings(stamp, np.linspace(0.0, 1.0, units), status)
        points = None
        if self._points:
            near = self._controller.model.kinematics(self._robot.q).position + np.array([0.0, 0.3, 0.1])
            count = len(near) if range_status is RangeStatus.OK else 0
            points = SeenPoints(self._now, np.full(count, self._now), near[:count], np.full(count, 0.01))
        stays = joint_positions(self._now, robot.q) if commanded else None
        inputs = Inputs(self._now, robot, readings, resume, points=points, desired=stays)
        _, self._state = self._controller.step(self._state, inputs)
