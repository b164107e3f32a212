"""Which inputs to believe, and what the arm does and says, as nested questions."""

import itertools
from dataclasses import replace

import numpy as np

from pretouch.modes import TABLE, Event
from pretouch.params import FailureParams
from pretouch.types import Inputs, Mode, RobotState

OLD = (
    "{:.3f} s old, because this machine is busy, perhaps without a real-time kernel, or the connection is slow: close"
    " other programs and check the connection to the arm"
)
AHEAD = "{:.3f} s in the future: use one clock for states and steps"
FAULTS = Event.UNUSABLE, Event.TIME_BACKWARDS, Event.STATE_STALE
PASSING = Event.SKIN_SILENT, Event.NO_FORCE, Event.OVERRUN, Event.WINDOW_FILLING
LARGEST = 1e3
"""What no joint position or velocity reaches [rad, rad/s]."""
LATEST = 1e12
"""Time stamp from which on it is none [s]."""


class Behaviour:
    """The mode, its reason, and whether it lasts until a person resumes."""

    def __init__(self) -> None:
        self.mode, self.reason, self.latched = Mode.HOLD, "The controller has not run yet.", False

    def decide(self, seen: dict[Event, str], resume: bool) -> None:
        """Go on to the next mode; `seen` maps an event to the detail its sentence needs."""
        fault = next((event for event in FAULTS if event in seen), None)
        if fault:
            self._be(Mode.HOLD, fault, seen, latched=True)
            return
        if self.latched and not resume:
            return
        if self.mode is not Mode.REACT and Event.CONTACT in seen:
            self._be(Mode.REACT, Event.CONTACT, seen)
            return
        if self.mode is Mode.REACT and Event.REACTING in seen:
            self._be(Mode.REACT, Event.REACTING, seen)
            return
        cause = next((event for event in PASSING if event in seen), Event.CLEAR)
        self._be(Mode.TRACK if cause is Event.CLEAR else Mode.HOLD, cause, seen)

    def blocked(self) -> None:
        """No joint velocities meet hard rows: hold, or stay with a contact, braking."""
        self._be(Mode.HOLD if self.mode is Mode.TRACK else Mode.REACT, Event.BLOCKED, {})

    def _be(self, mode: Mode, event: Event, seen: dict[Event, str], latched: bool = False) -> None:
        sentence = next(row.sentence for row in TABLE if row.event is event and row.target is mode)
        self.mode, self.reason, self.latched = mode, sentence.format(seen.get(event, "")), latched


class Trust:
    """What is remembered to judge the next inputs."""

    def __init__(self, robot: RobotState, params: FailureParams, qd_max: np.ndarray) -> None:
        self.params, self.robot, self.now, self.felt = params, robot, robot.stamp, robot.stamp
        self.qd_max = qd_max
        self.sent: list[tuple[float, np.ndarray]] = []

    def judge(self, inputs: Inputs, command: np.ndarray, period: float) -> tuple[RobotState, dict[Event, str]]:
        """Return the state to go by and what is wrong; a state that is not believed goes on by the last command."""
        robot, last, wrong, before = inputs.robot, self.robot, {}, self.now
        odd = unusable(inputs, self.qd_max)
        self.now = inputs.stamp if abs(inputs.stamp) < LATEST else before
        if odd:
            wrong[Event.UNUSABLE] = odd
        else:
            age = inputs.stamp - robot.stamp
            if abs(age) > self.params.state_timeout_s:
                wrong[Event.STATE_STALE] = OLD.format(age) if age > 0 else AHEAD.format(-age)
        kept = int(self.params.state_timeout_s / period) + 1
        self.sent = [*self.sent[-kept:], (before, command)]
        if self.now < before:
            wrong[Event.TIME_BACKWARDS] = f"from {before:.3f} s to {self.now:.3f} s"
            self.sent = []
        # a force cannot have been felt later than now
        self.felt = min(self.felt, self.now)
        if wrong:
            q = last.q_commanded + command * period
            self.robot = replace(last, q_commanded=q, qd_commanded=command, wrench=None)
            return self.robot, wrong
        if robot.stamp <= before < self.now:
            # it is from before the last command, and cannot tell of it nor of others since its time
            edges = [robot.stamp, *(t for t, _ in self.sent if t > robot.stamp), self.now]
            ahead = robot.q_commanded
            for start, end in itertools.pairwise(edges):
                held = [qd for t, qd in self.sent if t <= start] or [self.sent[0][1]]
                ahead = ahead + held[-1] * (end - start)
            robot = replace(robot, q_commanded=ahead, qd_commanded=command)
        if robot.wrench is not None:
            good = np.all(np.isfinite(robot.wrench)) and np.all(np.abs(robot.wrench) < self.params.force_max_n)
            robot = robot if good else replace(robot, wrench=None)
        if robot.wrench is not None:
            self.felt = self.now
        if self.now - before > self.params.overrun_s:
            wrong[Event.OVERRUN] = f"{self.now - before:.3f} s"
        if self.now - self.felt > self.params.force_timeout_s:
            wrong[Event.NO_FORCE] = f"{self.now - self.felt:.2f} s"
        self.robot = robot
        return robot, wrong


def unusable(inputs: Inputs, qd_max: np.ndarray) -> str:
    """Say the first thing that is no number, or no number a joint can have; '' if there is none."""
    robot = inputs.robot
    if not abs(robot.stamp) < LATEST:
        return f"RobotState.stamp holds {robot.stamp:g}, no number below {LATEST:g} in size"
    for name in ("q", "qd", "q_commanded", "qd_commanded"):
        for value, fastest in zip(getattr(robot, name), qd_max, strict=True):
            if not abs(value) < LARGEST:
                return f"RobotState.{name} holds {value:g}, no number below {LARGEST:g} in size"
            if name == "qd_commanded" and abs(value) >= 2 * fastest:
                return f"RobotState.{name} holds {value:g}, no number below 2 times its limit"
    return "" if abs(inputs.stamp) < LATEST else f"Inputs.stamp is {inputs.stamp!r}"
