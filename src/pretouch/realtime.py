"""Running the loop at 1 kHz on Linux: everything compiled first, no garbage collection, priority, and a processor."""

import ctypes
import gc
import math
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

import numpy as np

from pretouch import loop
from pretouch.controller import Controller
from pretouch.desired import joint_positions
from pretouch.errors import ParameterError
from pretouch.ports import Robot, Skin
from pretouch.signals import ended_in_order
from pretouch.types import ControlStep, FloatArray, Inputs, RangeReadings, RangeStatus, RobotState, SeenPoints

_PR_SET_TIMERSLACK, _PR_GET_TIMERSLACK = 29, 30
"""Of Linux' `prctl`."""

_WARM_UP_STEPS = 3
"""Steps of each kind: what one sees for the first time the next one remembers."""
_PUSH_NM = 50.0
"""External torque of each joint in a contact that is made up [Nm]."""
_NEWS_S = 0.5
"""Longest time the first state is waited for [s]: then the controller says how old the newest is."""
_LOOK_S = 0.001
"""Between two looks at whether a state has come [s]."""


@dataclass(frozen=True)
class Options(loop.Options):
    """What a loop in real time can do without."""

    priority: int | None = None
    """See `real_time`."""
    cpu: int | None = None
    """See `real_time`."""
    tell: Callable[[str], None] = print
    """Is given each sentence on what could not be had, before the loop begins."""


NO_OPTIONS = Options()


def run(
    controller: Controller, robot: Robot, skin: Skin, clock: loop.MonotonicClock, recorder: loop.Recorder,
    done: Callable[[ControlStep], bool], options: Options = NO_OPTIONS,
) -> None:  # fmt: skip
    """`loop.run`, warmed up and in a process prepared for real time. However it ends, `clock.timing()` is the report.

    SIGTERM and SIGHUP, where nobody else handles them, end it like Ctrl-C: the arm comes to rest first.

    Args:
        controller: its period must be the clock's.
        robot: the arm.
        skin: its sensor units.
        clock: gives the ticks and measures how they are kept.
        recorder: keeps the steps; it runs in the loop, so it must not wait for a disk.
        done: whether a step was the last.
        options: what it can do without.
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
    """Wait for a state measured from now on.

    Preparing keeps the interpreter from other threads, as from one that receives the arm's states: with the newest that
    it left, the first step would find the arm silent.
    """
    looks = loop.MonotonicClock(_LOOK_S)
    now = begun = looks.tick()
    while not robot.read().stamp >= begun and now < begun + _NEWS_S:
        now = looks.tick()


@contextmanager
def real_time(priority: int | None = None, cpu: int | None = None) -> Iterator[tuple[str, ...]]:
    """Prepare this process for a loop in real time, and undo it all afterwards.

    The garbage collector is off, and what is there already is frozen: a full collection stops a loop for a tenth of a
    second. Timers of this thread wake without slack. What the machine refuses is left out.

    Args:
        priority: of the thread in the scheduling class SCHED_FIFO, 1 to 99; None leaves the class as it is.
        cpu: number of the processor to stay on; None leaves that to the system.

    Yields:
        A sentence for each thing that could not be had.
    """
    check_wishes(priority, cpu)
    with ExitStack() as undo:
        undo.enter_context(_no_collections())
        if sys.platform == "linux":
            _sharpen_timers(undo)
            yield tuple(filter(None, (_go_first(priority, undo), _stay(cpu, undo))))
        else:
            yield (f"This is {sys.platform}, not Linux: the loop runs without priority, and wakes as late as it does.",)


def check_wishes(priority: int | None, cpu: int | None) -> None:
    """Raise ParameterError for a priority or processor there is not, naming those there are."""
    if sys.platform != "linux":
        return
    low, high = os.sched_get_priority_min(os.SCHED_FIFO), os.sched_get_priority_max(os.SCHED_FIFO)
    if priority is not None and not low <= priority <= high:
        raise ParameterError(f"The real-time priority is {priority}: give {low} to {high}.")
    allowed = sorted(os.sched_getaffinity(0))
    if cpu is not None and cpu not in allowed:
        raise ParameterError(
            f"Processor {cpu} is none this process may use: choose from {', '.join(map(str, allowed))}."
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
        if froze:  # what somebody else froze stays so
            gc.unfreeze()
        if was_on:
            gc.enable()


def _sharpen_timers(undo: ExitStack) -> None:
    """Take away the 50 us by which Linux lets the timers of ordinary threads be late."""
    prctl = getattr(ctypes.CDLL(None), "prctl", None)
    if prctl is None:
        return
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
        return f"Real-time priority {priority} is not to be had here ({error.strerror}): the loop runs without it."
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
            f"Staying on processor {cpu} was refused ({error.strerror}), so the loop may move: let the container or"
            " cpuset of this process have it."
        )
    undo.callback(os.sched_setaffinity, 0, before)
    return ""


def warm_up(controller: Controller, robot: RobotState, points: bool = False) -> None:
    """Run steps whose results are dropped, so that nothing is left to be compiled or loaded in the loop.

    They see obstacles and none, follow the path and a commander, meet a contact and a robot that cannot be believed:
    TRACK, REACT and HOLD. The controller and its arm are left as they are.

    Args:
        controller: the one that the loop will turn.
        robot: a state of the arm, as its interface gives it.
        points: whether there will be an outside source of points.
    """
    quiet, push = np.zeros(6), np.array([0.9 * controller.profile.failure.force_max_n, 0, 0, 0, 0, 0])
    lost = np.full(len(robot.q), np.nan)
    for seen in (RangeStatus.SIGNAL, RangeStatus.OK):
        rehearsal = _Rehearsal(controller, robot, points)
        for _ in range(controller.profile.window.samples):
            rehearsal.step(None, quiet)
        for wrench in (robot.wrench, None, quiet, push):
            for _ in range(_WARM_UP_STEPS):
                rehearsal.step(seen, wrench, _PUSH_NM if wrench is push else 0.0)
        for _ in range(_WARM_UP_STEPS):
            rehearsal.step(seen, quiet, asks=True)
        # a loss that latches, and the way out of it
        rehearsal.step(seen, quiet, q=lost)
        rehearsal.step(seen, quiet, resume=True)


class _Rehearsal:
    """A controller that is given made-up inputs, one period after another."""

    def __init__(self, controller: Controller, robot: RobotState, points: bool) -> None:
        self._controller, self._robot, self._now, self._points = controller, robot, robot.stamp, points
        self._state = controller.init(robot)

    def step(
        self, seen: RangeStatus | None, wrench: FloatArray | None, torque: float = 0.0, q: FloatArray | None = None,
        resume: bool = False, asks: bool = False,
    ) -> None:  # fmt: skip
        """Turn the controller once. All units say `seen`, at distances up to 1 m; without it they say nothing.

        `torque` of each joint is added to what the arm reports [Nm]: a detector may go by torques alone.
        """
        self._now += self._controller.limits.period
        units = len(self._controller.skin)
        stamp = np.full(units, -np.inf if seen is None else self._now)
        status = np.full(units, int(RangeStatus.NONE if seen is None else seen))
        robot = replace(self._robot, stamp=self._now, wrench=wrench, q=self._robot.q if q is None else q)
        if torque and robot.tau_ext is not None:
            robot = replace(robot, tau_ext=robot.tau_ext + torque)
        readings = RangeReadings(stamp, np.linspace(0.0, 1.0, units), status)
        points = None
        if self._points:
            near = self._controller.model.kinematics(self._robot.q).position + np.array([0.0, 0.3, 0.1])
            count = len(near) if seen is RangeStatus.OK else 0
            points = SeenPoints(self._now, np.full(count, self._now), near[:count], np.full(count, 0.01))
        stays = joint_positions(self._now, robot.q) if asks else None
        inputs = Inputs(self._now, robot, readings, resume, points=points, desired=stays)
        _, self._state = self._controller.step(self._state, inputs)
