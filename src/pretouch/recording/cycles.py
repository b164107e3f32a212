"""Encoding of a control cycle to bytes and back, to the bit."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from reprlib import Repr
from typing import Any, NamedTuple, get_args

import numpy as np

from pretouch.controller import Controller, ControllerState
from pretouch.errors import RecordingError
from pretouch.loop import Cycle
from pretouch.recording import ros
from pretouch.recording.disk import Item
from pretouch.recording.packing import decoder, packed, unpacked, with_parts
from pretouch.recording.ros import PACKED, encode, hints_of, own, packed_message
from pretouch.recording.run import packed_run
from pretouch.recording.simulation import Truth
from pretouch.recording.viewer_topics import KINDS, nanoseconds
from pretouch.types import ControlStep, FloatArray, Inputs, RangeReadings, RobotState, SeenPoints
from pretouch.values import value

SNAPSHOT_S = 3.0
"""Time between two snapshots of the controller's state [s]."""
RUN, INPUTS, STATE, STEP, TRUTH = (f"/pretouch/{name}" for name in ("run", "inputs", "state", "step", "truth"))
TOPICS = {RUN: PACKED, INPUTS: PACKED, STATE: PACKED, STEP: own("Step"), TRUTH: own("Truth")}
"""Type of the messages on each of our topics."""
_PARTS = {name: kinds[0] for name, hint in hints_of(Inputs) if (kinds := get_args(hint))}
"""Optional parts of inputs beside the arm's state and the readings."""
_SHOWN = 500
"""Characters of what cannot be kept that are."""
_REPR = Repr()  # answers for objects whose own repr fails, too
_REPR.maxother = _SHOWN


@value
class KeptInputs:
    """Inputs of a step as they are packed."""

    inputs: Inputs | None
    """Inputs of the step; None where they cannot be recorded."""
    points_at: int = -1
    """Number of the step with which the points of outside sources stand: a set is kept once; -1 without any."""
    unreadable: str = ""
    """Text of inputs that cannot be recorded."""


@value
class KeptState:
    """The controller's state before a step, as it is packed."""

    anew: bool
    """True if it does not follow from the step before."""
    state: ControllerState


class KeptCycle(NamedTuple):
    """Record of a cycle: bytes of arrays that others may overwrite, and values that nobody changes."""

    number: int
    """Number of the step."""
    time: int
    """[ns]"""
    run: bytes | None
    """Description of the run that begins here."""
    state: bytes | None
    """The state the step began with: from here on a file can begin."""
    inputs: bytes
    step: ControlStep
    truth: Truth | None


def prepare() -> None:
    """Make the code that packs and encodes cycles: at the first one, a control loop would wait for it."""
    ros.prepare(*TOPICS.values(), *KINDS)
    decoder(KeptInputs)
    zero = np.zeros(1)
    robot = RobotState(0.0, zero, zero, zero, zero, zero, None)
    inputs_of(packed_inputs(Inputs(0.0, robot, RangeReadings(zero, zero, np.zeros(1, np.int64)))))


class Cycles:
    """Makes what is kept of each cycle of one controller after the other."""

    def __init__(self, controller: Controller, about: Mapping[str, Any]) -> None:
        prepare()
        self._about = dict(about)
        self._number = self._time = 0
        self._last = math.nan
        self._points: SeenPoints | None = None
        self._points_at = -1
        self.change(controller)

    def change(self, controller: Controller) -> None:
        """Let the cycles from the next one on be those of a controller."""
        self._run: bytes | None = packed_run(controller, self._about)
        self._snapshot_due = -math.inf
        self._command: FloatArray | None = None
        """Command of the last step; None where the next one cannot be recomputed from it."""

    def keep(self, cycle: Cycle, truth: Truth | None = None) -> KeptCycle:
        """Return what is kept of the next cycle, and of what only a simulation knows."""
        number, step, run = self._number, cycle.step, self._run
        self._time = nanoseconds(step.stamp, self._time)
        anew = not self._goes_on(cycle)
        state = None
        if anew or not self._last <= step.stamp < self._snapshot_due:
            state = packed_state(cycle.before, anew)
            self._snapshot_due = step.stamp + SNAPSHOT_S
            self._points = None
        inputs, whole = self._inputs(cycle.inputs)
        self._command = step.command if whole else None
        self._number, self._last, self._run = number + 1, step.stamp, None
        return KeptCycle(number, self._time, run, state, inputs, step, truth)

    def _goes_on(self, cycle: Cycle) -> bool:
        """Return True if a cycle began with the state that the one before left, and that can be recomputed."""
        memory, command = cycle.before.memory, self._command
        follows = command is not None and memory.get("watch.stamp") == self._last
        return follows and bool((memory.get("command") == command).all())

    def _inputs(self, inputs: Inputs) -> tuple[bytes, bool]:
        """Return inputs as they are kept, and whether that is all a step goes by."""
        try:
            points = inputs.points
            if points is not None and points is not self._points:
                self._points, self._points_at = points, self._number
            elif points is not None:
                inputs = replace(inputs, points=None)
            return packed_inputs(inputs, self._points_at if points is not None else -1), True
        except Exception as error:  # inputs may be anything, with any behaviour
            self._points = None
            sentence = f"{error}: {_REPR.repr(inputs)}"[:_SHOWN].encode("utf-8", "backslashreplace").decode()
            return packed(KeptInputs(None, -1, sentence)), False


def packed_inputs(inputs: Inputs, points_at: int = -1) -> bytes:
    """Return inputs as they are kept; raises for what cannot be. `points_at` is the step that has their points."""
    robot = inputs.robot
    if type(robot) is not RobotState or type(inputs.readings) is not RangeReadings:
        raise TypeError("the arm's state or the readings are none")
    for name, kind in _PARTS.items():
        part = getattr(inputs, name)
        if part is not None and type(part) is not kind:
            raise TypeError(f"{name} is a {type(part).__name__}")
    if not isinstance(robot.tau_ext, np.ndarray):  # such are no torques to a step either
        inputs = replace(inputs, robot=replace(robot, tau_ext=np.zeros(0)))
    return packed(KeptInputs(inputs, points_at))


def inputs_of(data: bytes) -> KeptInputs:
    """Return what a step was given."""
    try:
        return unpacked(KeptInputs, data)
    except RecordingError as error:
        return KeptInputs(None, -1, str(error))


def packed_state(state: ControllerState, anew: bool) -> bytes:
    """Return the state a step begins with; `anew` if it does not follow from the step before."""
    try:
        return packed({"anew": anew, "state": with_parts(state)})
    except TypeError as error:
        raise RecordingError(
            f"The controller's state cannot be kept, because a part of the profile remembers what a recording cannot"
            f" hold ({error}): let it remember numbers, arrays of numbers, or classes of such fields."
        ) from error


def items(cycle: KeptCycle) -> Iterator[Item]:
    """Yield the messages of a cycle."""
    number, time = cycle.number, cycle.time
    for topic, data in ((RUN, cycle.run), (STATE, cycle.state), (INPUTS, cycle.inputs)):
        if data is not None:
            yield Item(topic, PACKED, number, time, packed_message(number, data))
    for topic, result in ((STEP, cycle.step), (TRUTH, cycle.truth)):
        if result is not None:
            yield Item(topic, TOPICS[topic], number, time, encode(result, number))
