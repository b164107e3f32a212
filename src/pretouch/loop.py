"""The only clock of the package, and the loop that turns the controller: read, step, command, record."""

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
from pretouch.ports import Clock, Points, Robot, Skin, touch_of
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
"""Shortest time `Durations` tells apart [s]."""
_ROUNDING_RAD_S = 1e-6
"""By how much the report of a command may be rounded [rad/s]."""
_ENCODER_RAD = 0.02
"""By how much a measured joint position may jump [rad]: what an encoder and a joint's elasticity can do."""
_LAG_S = 0.025
"""By how much an arm may lag behind the last command [s]: its way there, and a pause of the process that brings it."""
_WAIT_S = 0.5
"""How long a busy machine may keep a loop waiting between its tick and what it reads [s]: beyond, a stamp of after the
tick is another clock's."""
_BINS_PER_E = 1.0 / math.log(1.01)
_BINS = 2316
"""Bins one per cent wide from a tenth of a microsecond to a thousand seconds."""


@dataclass(frozen=True, slots=True)
class Spread:
    """How some durations are spread [s], each within half a per cent but the largest, which is exact."""

    median: float
    p99: float
    p999: float
    max: float


class Durations:
    """Any number of durations in fixed memory: a loop may run for days."""

    def __init__(self) -> None:
        self._counts = [0] * _BINS
        self._largest = 0.0
        self.count = 0
        """How many were added."""

    def add(self, duration: float) -> None:
        """Take one in [s]."""
        place = int(math.log(duration / _FINEST) * _BINS_PER_E) if duration > _FINEST else 0
        self._counts[min(place, _BINS - 1)] += 1
        self.count += 1
        if duration > self._largest:
            self._largest = duration

    def spread(self) -> Spread:
        """Median, 99 %, 99.9 % and the largest so far; zeros of none."""
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
    """How a loop kept its time."""

    period: float
    """Period it was asked to keep [s]."""
    cycles: int
    """Ticks given."""
    measured: Spread
    """Time from one tick to the next [s]."""
    wake_up: Spread
    """How late the machine woke the loop for a tick it waited for [s]."""
    busy: Spread
    """Time from a tick until the next one was asked for [s]."""
    cpu: Spread
    """Processor time of the loop's thread in that time [s]."""
    overruns: int
    """Cycles that were busy for longer than a period."""
    missed: int
    """Ticks left out, because the loop was late by a period or more."""

    def __str__(self) -> str:
        rows = {"period": self.measured, "late wake-up": self.wake_up, "busy": self.busy, "busy, CPU": self.cpu}
        return (
            f"{self.cycles} cycles at {1 / self.period:g} Hz: {self.overruns} overruns, {self.missed} ticks missed.\n"
            + spread_table(rows)
        )


class MonotonicClock:
    """The machine's monotonic clock, ticking at a fixed period, and how well the caller kept up with it.

    The first tick is at once, the others a whole number of periods after it. A late caller gets the next tick, not a
    burst.
    """

    def __init__(self, period: float) -> None:
        """Take the period [s]."""
        if not (math.isfinite(period) and period > 0):
            raise ParameterError(f"The period of the clock is {period} s: it must be greater than 0.")
        self.period = period
        self.missed = 0
        """Ticks that went by unused because the caller was late."""
        self.overruns = 0
        """Cycles of the caller that took longer than a period."""
        self._next = self._given = -math.inf
        self._cpu_given = 0.0
        self._cycles = 0
        self._measured, self._wake_up, self._busy, self._cpu = Durations(), Durations(), Durations(), Durations()

    def tick(self) -> float:
        """Wait for the next tick and return the time [s]."""
        now = time.monotonic()
        if self._cycles:
            busy = now - self._given
            self._busy.add(busy)
            self._cpu.add(time.thread_time() - self._cpu_given)
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
            self._measured.add(now - self._given)
        self._next += self.period
        self._cycles += 1
        self._given, self._cpu_given = now, time.thread_time()
        return now

    def timing(self) -> Timing:
        """Report on all ticks so far; what the caller does since the last one is not in it."""
        measured, wake_up = self._measured.spread(), self._wake_up.spread()
        busy, cpu = self._busy.spread(), self._cpu.spread()
        return Timing(self.period, self._cycles, measured, wake_up, busy, cpu, self.overruns, self.missed)


@value
class Cycle:
    """One turn of the loop: `controller.step(before, inputs)` gives `step` and `after` again."""

    inputs: Inputs
    before: ControllerState
    step: ControlStep
    after: ControllerState


class Recorder(Protocol):
    """Something that keeps what the loop did."""

    def record(self, cycle: Cycle) -> None:
        """Keep one turn of the loop."""
        ...


@dataclass(frozen=True)
class Options:
    """What a loop can do without."""

    resume: Callable[[], bool] = lambda: False
    """Whether a person now asks to leave a latched HOLD."""
    learnt: ResidualModel | None = None
    """Free motion as an earlier session left it."""
    points: Points | None = None
    """An outside source of points, read in the loop, so it must not wait; once there is one, its silence stops the
    arm."""
    payload: Callable[[], Payload | None] = lambda: None
    """What the arm carries, asked in the loop; None: nothing is said, and what was said last stays."""
    desired: Callable[[], Desired | None] = lambda: None
    """What a commander asks for, asked in the loop: the newest again while there is no newer; None: the path."""
    moving: Callable[[], MovingFixtures | None] = lambda: None
    """What is known to move beside the arm, asked in the loop; None: nothing is said of any."""


NO_OPTIONS = Options()


def run(
    controller: Controller, robot: Robot, skin: Skin, clock: Clock, recorder: Recorder,
    done: Callable[[ControlStep], bool], options: Options = NO_OPTIONS,
) -> None:  # fmt: skip
    """Turn the controller until `done` says so of a step. However it ends, the arm is first brought to rest."""
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
    controller: Controller, state: ControllerState, robot: Robot, skin: Skin, tick: float,
    options: Options = NO_OPTIONS,
) -> Cycle:  # fmt: skip
    """Turn the controller once, at a tick [s]: read, step, command."""
    resume, payload, desired, points = options.resume(), options.payload(), options.desired(), options.points
    report, readings, touch = robot.read(), skin.read(), touch_of(skin)
    seen = None if points is None else points.read()
    stamp = instant(tick, controller.limits.period, report, readings, touch)
    believed = explained(controller, state, report, stamp)
    inputs = Inputs(stamp, believed, readings, resume, touch, seen, payload, desired, options.moving())
    step, after = controller.step(state, inputs)
    robot.command(step.command)
    return Cycle(inputs, state, step, after)


def explained(controller: Controller, state: ControllerState, robot: RobotState, now: float) -> RobotState:
    """Return an arm's report with NaN for joints that no recent command, or no motion, explains; `now` is in s.

    A loop that commands asks before each step: the next command may differ from the reported one by so much only, so a
    false report would move the arm. An arm that gets no command holds its velocity or brakes, so a late step widens
    what is explained towards rest only. A joint's velocity is explained between the least and the largest of the
    commands that the report may be of, the last one braked for as long as the step is late, and one period of
    acceleration beyond; its position by speed and acceleration limit since the last report. While a HOLD is latched a
    person looks before the arm moves: whatever acceleration reaches since the last report is then explained. What is no
    report of an arm stays as it is, for the step to name.
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
    if stamp > before:  # of after the last command, which it cannot lag behind by all of them
        reach = reach + limits.qdd_max * _LAG_S
        explicable &= reported >= np.minimum(command, braked) - reach
        explicable &= reported <= np.maximum(command, braked) + reach
    return robot if explicable.all() else replace(robot, qd_commanded=np.where(explicable, reported, np.nan))


def instant(
    tick: float, period: float, report: RobotState, readings: RangeReadings, touch: TouchReadings | None
) -> float:
    """Instant of a step [s]: a port that stamps what it reads as it reads it is a little later than the tick.

    The arm's report may be later than that: a busy machine may keep the loop waiting between the two.
    """
    latest = tick
    for port, most in ((report, _WAIT_S), (readings, period), (touch, period)):
        with suppress(TypeError, ValueError):  # the controller names what is wrong
            stamps = real(getattr(port, "stamp", tick), copy=False)
            latest = float(stamps[(stamps > latest) & (stamps <= latest + most)].max(initial=latest))
    return latest


def come_to_rest(limits: JointLimits, robot: Robot, clock: Clock, q: FloatArray, qd: FloatArray) -> None:
    """Command the arm from its last command to rest, within its limits.

    Where the arm is by then is reckoned from the commands: the robot's state may be what ended the loop. Ticks and
    commands that fail do not end it: after a tick that failed the next command follows at once, and a command that
    failed is given again, for up to twice the time that braking takes. Raises the first of their errors at the end,
    whether the arm was brought to rest or not.

    Args:
        limits: of the joints, with the period.
        robot: to command.
        clock: one tick for each command.
        q: (n,) joint positions the motion generator was last known to be at [rad].
        qd: (n,) joint velocities sent last [rad/s].
    """
    # each cycle takes one period's worth of acceleration from the joint that needs longest; one more for rounding
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
