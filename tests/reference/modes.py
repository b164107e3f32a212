"""Which inputs to believe, and what the arm does and says, as nested questions."""

import itertools
from dataclasses import replace

import numpy as np

from pretouch.params import FailureParams
from pretouch.types import Inputs, Mode, RobotState

UNUSABLE = "The robot's state cannot be used ({}): check the connection to the arm, then resume."
BACKWARDS = "Time went backwards ({}): let one monotonic clock stamp everything, then resume."
STALE = "The robot's state is {}, then resume."
OLD = (
    "{:.3f} s old, for this machine is busy, perhaps without a real-time kernel, or the connection is slow: close other"
    " programs and check the connection to the arm"
)
AHEAD = "{:.3f} s in the future: let one clock stamp states and steps"
BLOCKED = "The approach limits cannot be met within the acceleration limits: braking and trying again."
BLOCKED_REACT = (
    "Moving with a contact, but the approach limits allow no motion within the acceleration limits: braking."
)
CONTACT = "A contact of {}: yielding to what moves the arm."
REACTING = "Moving with a contact: {} left."
SILENT = "No usable reading from {}: check the unit's power, radio and sensor; the arm goes on when it is heard again."
NO_FORCE = (
    "The robot has given no force estimate for {}, as near a singularity, and contacts could not be detected: guide the"
    " arm to another posture."
)
OVERRUN = (
    "The step before this one was {} ago, for this machine is busy, perhaps without a real-time kernel: braking, then"
    " going on. Close other programs, and give the controller a process of its own."
)
FILLING = (
    "The force window is filling ({}): contacts cannot be distinguished from noise yet. The arm moves once it is full."
)
TRACKING = "Moving as asked."

LARGEST = 1e3
"""What no joint position or velocity reaches [rad, rad/s]."""
LATEST = 1e12
"""Time stamp from which on it is none [s]."""


class Behaviour:
    """The mode, its reason, and whether it lasts until a person resumes."""

    def __init__(self) -> None:
        self.mode, self.reason, self.latched = Mode.HOLD, "The controller has not run yet.", False

    def decide(self, seen: dict[str, str], resume: bool) -> None:
        """Go on to the next mode; `seen` maps a sentence to the detail it needs."""
        for sentence in (UNUSABLE, BACKWARDS, STALE):
            if sentence in seen:
                self._be(Mode.HOLD, sentence.format(seen[sentence]), latched=True)
                return
        if self.latched and not resume:
            return
        if self.mode is not Mode.REACT and CONTACT in seen:
            self._be(Mode.REACT, CONTACT.format(seen[CONTACT]))
            return
        if self.mode is Mode.REACT and REACTING in seen:
            self._be(Mode.REACT, REACTING.format(seen[REACTING]))
            return
        for sentence in (SILENT, NO_FORCE, OVERRUN, FILLING):
            if sentence in seen:
                self._be(Mode.HOLD, sentence.format(seen[sentence]))
                return
        self._be(Mode.TRACK, TRACKING)

    def blocked(self) -> None:
        """No joint velocities meet hard rows: hold, or stay with a contact, braking."""
        if self.mode is Mode.TRACK:
            self._be(Mode.HOLD, BLOCKED)
        else:
            self._be(Mode.REACT, BLOCKED_REACT)

    def _be(self, mode: Mode, reason: str, latched: bool = False) -> None:
        self.mode, self.reason, self.latched = mode, reason, latched


class Trust:
    """What is remembered to judge the next inputs."""

    def __init__(self, robot: RobotState, params: FailureParams, qd_max: np.ndarray) -> None:
        self.params, self.robot, self.now, self.felt = params, robot, robot.stamp, robot.stamp
        self.qd_max = qd_max
        self.sent: list[tuple[float, np.ndarray]] = []

    def judge(self, inputs: Inputs, command: np.ndarray, period: float) -> tuple[RobotState, dict[str, str]]:
        """Return the state to go by and what is wrong; a state that is not believed goes on by the last command."""
        robot, last, wrong, before = inputs.robot, self.robot, {}, self.now
        odd = unusable(inputs, self.qd_max)
        self.now = inputs.stamp if abs(inputs.stamp) < LATEST else before
        if odd:
            wrong[UNUSABLE] = odd
        else:
            age = inputs.stamp - robot.stamp
            if abs(age) > self.params.state_timeout_s:
                wrong[STALE] = OLD.format(age) if age > 0 else AHEAD.format(-age)
        kept = int(self.params.state_timeout_s / period) + 1
        self.sent = [*self.sent[-kept:], (before, command)]
        if self.now < before:
            wrong[BACKWARDS] = f"from {before:.3f} s to {self.now:.3f} s"
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
            wrong[OVERRUN] = f"{self.now - before:.3f} s"
        if self.now - self.felt > self.params.force_timeout_s:
            wrong[NO_FORCE] = f"{self.now - self.felt:.2f} s"
        self.robot = robot
        return robot, wrong


def unusable(inputs: Inputs, qd_max: np.ndarray) -> str:
    """Say the first thing that is no number, or no number a joint can have; '' if there is none."""
    robot = inputs.robot
    if not abs(robot.stamp) < LATEST:
        return f"its time stamp is {robot.stamp}"
    parts = {
        "joint positions": robot.q,
        "joint velocities": robot.qd,
        "commanded joint positions": robot.q_commanded,
        "commanded joint velocities": robot.qd_commanded,
    }
    for name, values in parts.items():
        for value, fastest in zip(values, qd_max, strict=True):
            if np.isnan(value) or abs(value) >= (2 * fastest if values is robot.qd_commanded else LARGEST):
                return f"{name} hold {value:g}"
    return "" if abs(inputs.stamp) < LATEST else f"the step's time stamp is {inputs.stamp}"
