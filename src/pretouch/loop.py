"""The only clock of the package, and the control loop: read, step, command, record."""

import math
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import astuple, dataclass, replace
from typing import Protocol

import numpy as np

from pretouch.contact.residual_model import ResidualModel
from pretouch.control.joint_box import JointLimits, joint_box
from pretouch.controller import Controller, ControllerState
from pretouch.desired import Desired
from pretouch.errors import ParameterError
from pretouch.ports import Clock, Points, Robot, SkinPort, touch_of
from pretouch.signals import noted
from pretouch.sound import time_of
from pretouch.types import (
    ControlStep,
    FloatArray,
    Inputs,
    MovingFixtures,
    Payload,
    RangeReadings,
    RobotState,
    TouchReadings,
)
from pretouch.values import real, value

_FINEST = 1e-7
"""Resolution of `Durations` [s]."""
_ROUNDING_RAD_S = 1e-6
"""Rounding of a reported command, at most [rad/s]."""
_ENCODER_RAD = 0.02
"""Jump of a measured joint position, at most [rad]: by the encoder and the joint's elasticity."""
_LAG_S = 0.025
"""Lag of an arm behind the last command, at most [s]: transport, and a pause of the process that sends it."""
_WAIT_S = 0.5
"""Longest time from a tick until a busy machine reads the ports [s]: a later stamp belongs to another clock."""
_BINS_PER_E = 1.0 / math.log(1.01)
_BINS = 2316
"""Bins one per cent wide from a tenth of a microsecond to a thousand seconds."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Quantiles of some durations [s], each within half a per cent but the largest, which is exact."""

    median: float
    p99: float
    p999: float
    max: float


class Durations:
    """Statistics of any number of durations in fixed memory: a loop may run for days."""

    def __init__(self) -> None:
        self._counts = [0] * _BINS
        self._largest = 0.0
        self.count = 0
        """Number of durations."""

    def add(self, duration: float) -> None:
        """Add a duration [s]."""
        place = int(math.log(duration / _FINEST) * _BINS_PER_E) if duration > _FINEST else 0
        self._counts[min(place, _BINS - 1)] += 1
        self.count += 1
        if duration > self._largest:
            self._largest = duration

    def spread(self) -> Spread:
        """Return median, 99 %, 99.9 % and the largest so far; zeros without any."""
        below = np.cumsum(self._counts)
        places = np.searchsorted(below, np.array([0.5, 0.99, 0.999]) * self.count)
        middle = _FINEST * np.exp((places + 0.5) / _BINS_PER_E)
        median, p99, p999 = np.minimum(middle, self._largest).tolist()
        return Spread(median, p99, p999, self._largest)


def spread_table(rows: dict[str, Spread]) -> str:
    """Return spreads as lines of a table [us]."""
    lines = [f"{'[us]':14}{'median':>10}{'99 %':>10}{'99.9 %':>10}{'largest':>10}"]
    lines += [f"{name:14}" + "".join(f"{1e6 * time:10.0f}" for time in astuple(s)) for name, s in rows.items()]
    return "\n".join(lines)


@dataclass(frozen=True, slots=True)
class Timing:
    """Timing of a loop."""

    period: float
    """Nominal period [s]."""
    cycles: int
    """Number of ticks."""
    measured: Spread
    """Time from one tick to the next [s]."""
    wake_up: Spread
    """Delay of the wake-up for a tick [s]."""
    busy: Spread
    """Time from a tick until the request for the next one [s]."""
    cpu: Spread
    """Processor time of the loop's thread in that time [s]."""
    overruns: int
    """Cycles that were busy for longer than a period."""
    missed: int
    """Ticks that were left out because the loop was late by a period or more."""

    def __str__(self) -> str:
        rows = {"period": self.measured, "late wake-up": self.wake_up, "busy": self.busy, "busy, CPU": self.cpu}
        return (
            f"{self.cycles} cycles at {1 / self.period:g} Hz: {self.overruns} overruns, {self.missed} ticks missed.\n"
            + spread_table(rows)
        )


class MonotonicClock:
    """The machine's monotonic clock with a fixed period, and the timing of its caller.

    The first tick comes at once, the others a whole number of periods after it. A late caller gets the next tick, not
    a burst.
    """

    def __init__(self, period: float) -> None:
        """Take the period [s]."""
        if not (math.isfinite(period) and period > 0):
            raise ParameterError(f"The period of the clock is {period} s: it must be greater than 0.")
        self.period = period
        self.missed = 0
        """Ticks that were left out because the caller was late."""
        self.overruns = 0
        """Cycles of the caller that took longer than a period."""
        self._next = self._ticked = -math.inf
        self._cpu_ticked = 0.0
        self._cycles = 0
        self._measured, self._wake_up, self._busy, self._cpu = Durations(), Durations(), Durations(), Durations()

    def tick(self) -> float:
        """Wait for the next tick and return the time [s]."""
        now = time.monotonic()
        if self._cycles:
            busy = now - self._ticked
            self._busy.add(busy)
            self._cpu.add(time.thread_time() - self._cpu_ticked)
            self.overruns += busy > self.period
            late = int((now - self._next) / self.period)
            if late > 0:
                self.missed += late
                self._next += late * self.period
        else:
            self._next = now
        if self._next > now:
            time.sleep(self._next - now)
            now = time.monotonic()
            self._wake_up.add(now - self._next)
        if self._cycles:
            self._measured.add(now - self._ticked)
        self._next += self.period
        self._cycles += 1
        self._ticked, self._cpu_ticked = now, time.thread_time()
        return now

    def timing(self) -> Timing:
        """Return the timing of all ticks so far, without the current cycle of the caller."""
        measured, wake_up = self._measured.spread(), self._wake_up.spread()
        busy, cpu = self._busy.spread(), self._cpu.spread()
        return Timing(self.period, self._cycles, measured, wake_up, busy, cpu, self.overruns, self.missed)


@value
class Cycle:
    """One cycle of the loop: `controller.step(before, inputs)` reproduces `step` and `after`."""

    inputs: Inputs
    before: ControllerState
    step: ControlStep
    after: ControllerState


class Recorder(Protocol):
    """Records the cycles of the loop."""

    def record(self, cycle: Cycle) -> None:
        """Record one cycle of the loop."""
        ...


@dataclass(frozen=True)
class Options:
    """Optional inputs of a loop."""

    resume: Callable[[], bool] = lambda: False
    """Returns whether a person now requests to leave a latched HOLD."""
    learnt: ResidualModel | None = None
    """Model of free motion from an earlier session."""
    points: Points | None = None
    """An outside source of points. The loop reads it, so it must not wait; its silence stops the arm."""
    payload: Callable[[], Payload | None] = lambda: None
    """Returns the load that is announced; None: the last announcement stays."""
    desired: Callable[[], Desired | None] = lambda: None
    """Returns the newest motion that a commander requests, also more than once; None: the arm follows the path."""
    moving: Callable[[], MovingFixtures | None] = lambda: None
    """Returns the bodies beside the arm whose motion is known; None without any."""


NO_OPTIONS = Options()


def run(
    controller: Controller, robot: Robot, skin: SkinPort, clock: Clock, recorder: Recorder,
    done: Callable[[ControlStep], bool], options: Options = NO_OPTIONS,
) -> None:  # fmt: skip
    """Run the control loop until `done` is true of a step. However it ends, the arm is first brought to rest."""
    state = controller.init(robot.read(), options.learnt)
    sent = state.memory.get("command")
    try:
        while True:
            tick = clock.tick()
            cycle = turn(controller, state, robot, skin, tick, options)
            state, sent = cycle.after, cycle.step.command
            recorder.record(cycle)
            if done(cycle.step):
                return
    finally:
        with noted():  # until the arm is at rest
            come_to_rest(controller.limits, robot, clock, state.robot.q_commanded, sent)


def turn(
    controller: Controller, state: ControllerState, robot: Robot, skin: SkinPort, tick: float,
    options: Options = NO_OPTIONS,
) -> Cycle:  # fmt: skip
    """Run one control cycle, at a tick [s]: read, step, command."""
    resume, payload, desired, points = options.resume(), options.payload(), options.desired(), options.points
    report, readings, touch = robot.read(), skin.read(), touch_of(skin)
    outside = None if points is None else points.read()
    stamp = instant(tick, controller.limits.period, report, readings, touch)
    state_of_arm = explained(controller, state, report, stamp)
    inputs = Inputs(stamp, state_of_arm, readings, resume, touch, outside, payload, desired, options.moving())
    step, after = controller.step(state, inputs)
    robot.command(step.command)
    return Cycle(inputs, state, step, after)


def explained(controller: Controller, state: ControllerState, robot: RobotState, now: float) -> RobotState:
    """Return an arm's report with NaN for joints that neither the recent commands nor any motion explain.

    A loop calls this before each step, at `now` [s]: the next command may differ from the reported one by so much only,
    so a false report would move the arm. An arm without a new command holds its velocity or brakes, so after a late
    step a wider range of velocities is explained, but only towards rest. A velocity is explained from the least to the
    largest of the commands that the report may contain, the last one braked for as long as the step is late, and by
    one period of acceleration beyond; a position by speed and acceleration limit since the last report. During a
    latched HOLD a person looks before the arm moves, so all that the acceleration limit allows since the last report is
    explained. A value that is no report of an arm stays as it is: the step names the fault.
    """
    limits, memory = controller.limits, controller.with_places(state.memory)
    command, position, before = (memory.get(name) for name in ("command", "watch.robot.q", "watch.stamp"))
    try:
        q, reported, stamp = real(robot.q, copy=False), real(robot.qd_commanded, copy=False), time_of(robot.stamp)
    except (AttributeError, TypeError, ValueError, OverflowError):
        return robot
    if stamp is None or q.shape != command.shape or reported.shape != command.shape:
        return robot
    late, moved = max(0.0, now - before - limits.period), np.abs(q - position)
    if not (moved <= _ENCODER_RAD).all():  # hardly ever at 1 kHz
        # stamps may be times of arrival: states that waited together come together
        gap = max(limits.period, stamp - memory.get("watch.robot.stamp"))
        accelerated = gap if state.mode.latched else max(limits.period, gap - late)
        speed = np.maximum(np.minimum(np.abs(memory.get("watch.robot.qd")), limits.qd_max), np.abs(command))
        reach = speed * (gap + controller.profile.failure.state_timeout_s) + limits.qdd_max * accelerated**2
        if (jumped := moved > reach + _ENCODER_RAD).any():
            return replace(robot, q=np.where(jumped, np.nan, q))
    reach = limits.qdd_max * limits.period + _ROUNDING_RAD_S
    if (np.abs(reported - command) <= reach).all():  # nearly always, and all commands would cost 10 us at 1 kHz
        return robot
    braked = np.sign(command) * np.maximum(np.abs(command) - limits.qdd_max * late, 0.0)
    recent = np.array([command, braked, *memory.get("watch.sent_command")[: memory.get("watch.sent")]])
    explicable = (reported >= recent.min(axis=0) - reach) & (reported <= recent.max(axis=0) + reach)
    if stamp > before:  # from after the last command: the lag cannot cover all commands
        reach = reach + limits.qdd_max * _LAG_S
        explicable &= reported >= np.minimum(command, braked) - reach
        explicable &= reported <= np.maximum(command, braked) + reach
    return robot if explicable.all() else replace(robot, qd_commanded=np.where(explicable, reported, np.nan))


def instant(
    tick: float, period: float, report: RobotState, readings: RangeReadings, touch: TouchReadings | None
) -> float:
    """Return the instant of a step [s]: the newest of the tick and of the stamps that ports give when they are read.

    The arm's report may be later than the others: a busy machine may stop the loop after the tick.
    """
    latest = tick
    for port, most in ((report, _WAIT_S), (readings, period), (touch, period)):
        with suppress(TypeError, ValueError):  # the controller names what is wrong
            stamps = real(getattr(port, "stamp", tick), copy=False)
            latest = float(stamps[(stamps > latest) & (stamps <= latest + most)].max(initial=latest))
    return latest


def come_to_rest(limits: JointLimits, robot: Robot, clock: Clock, q: FloatArray, qd: FloatArray) -> None:
    """Command the arm from its last command to rest, within its limits.

    The commands give the arm's positions, for a fault of the robot's state may have ended the loop. Failing ticks and
    commands do not end the braking: after a failed tick the next command follows at once, and a failed command is
    repeated, for up to twice the time that braking takes. Raises the first of the errors at the end, whether the arm
    was brought to rest or not.

    Args:
        limits: of the joints, with the period.
        robot: to command.
        clock: one tick for each command.
        q: (n,) last reported joint positions of the motion generator [rad].
        qd: (n,) last joint velocity command [rad/s].
    """
    # each cycle slows the joint that needs longest by one period of acceleration; one cycle more for rounding
    longest = math.ceil(float((limits.qd_max / limits.qdd_max).max()) / limits.period) + 1
    errors: list[Exception] = []
    for _ in range(2 * longest):
        if not np.any(qd):
            break
        try:
            clock.tick()
        except Exception as error:
            errors.append(error)
        q = q + qd * limits.period
        _, _, slower = joint_box(q, qd, limits.table)
        try:
            robot.command(slower)
            qd = slower
        except Exception as error:
            errors.append(error)
    if errors:
        raise errors[0]
