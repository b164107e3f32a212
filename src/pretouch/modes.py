"""Modes of the arm and their causes: one transition table with a sentence for each; outcomes of the QP."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Mode(Enum):
    """Behaviour of the arm."""

    TRACK = "track"
    """Follow the path, slowed and restricted near obstacles."""
    REACT = "react"
    """Yield to a contact (eq. 12)."""
    HOLD = "hold"
    """Brake within limits, stand still, and say why."""


class Event(Enum):
    """Causes of a change of the mode, as one control step detects them."""

    UNUSABLE = "unusable"
    TIME_BACKWARDS = "time_backwards"
    STATE_STALE = "state_stale"
    SOLVER_FAILED = "solver_failed"
    BLOCKED = "blocked"
    OVERRUN = "overrun"
    LATCHED = "latched"
    REACTING = "reacting"
    CLAMPED = "clamped"
    OPENING = "opening"
    YIELDING = "yielding"
    CONTACT = "contact"
    SKIN_UNFIT = "skin_unfit"
    SKIN_SILENT = "skin_silent"
    POINTS_LOST = "points_lost"
    MOVING_LOST = "moving_lost"
    LOAD_UNFIT = "load_unfit"
    DESIRED_UNFIT = "desired_unfit"
    DESIRED_STALE = "desired_stale"
    NO_FORCE = "no_force"
    GIVEN_UP = "given_up"
    PRESSED = "pressed"
    WINDOW_FILLING = "window_filling"
    CLEAR = "clear"


@dataclass(frozen=True)
class Transition:
    """On `event` in one of the modes `source`, go to `target` and say `sentence` with the event's detail."""

    event: Event
    source: frozenset[Mode]
    target: Mode
    sentence: str
    latches: bool = False
    """True if the HOLD lasts until a person resumes."""
    soft: bool = False
    """True if the arm may yield to a push during the HOLD: not where state, time or solution cannot be trusted."""


_ANY, _MOVES = frozenset(Mode), frozenset({Mode.REACT})


def _latching(event: Event, sentence: str) -> Transition:
    return Transition(event, _ANY, Mode.HOLD, sentence, latches=True)


def _soft(event: Event, sentence: str) -> Transition:
    return Transition(event, _ANY, Mode.HOLD, sentence, soft=True)


TABLE: tuple[Transition, ...] = (
    _latching(Event.UNUSABLE, "The robot's state cannot be used ({}): check the connection to the arm, then resume."),
    _latching(Event.TIME_BACKWARDS, "Time went backwards ({}): use one monotonic clock for all stamps, then resume."),
    _latching(Event.STATE_STALE, "The robot's state is {}, then resume."),
    _latching(Event.SOLVER_FAILED, "The quadratic program was not solved ({}): look at the last steps, then resume."),
    Transition(
        Event.BLOCKED,
        frozenset({Mode.TRACK}),
        Mode.HOLD,
        "The approach limits cannot be met within the acceleration limits: the arm brakes and tries again.",
    ),
    Transition(
        Event.BLOCKED,
        _MOVES,
        Mode.REACT,
        "Moving with a contact, but the approach limits allow no motion within the acceleration limits: braking.",
    ),
    Transition(Event.LATCHED, frozenset({Mode.HOLD}), Mode.HOLD, "as before", latches=True),
    Transition(Event.CONTACT, frozenset({Mode.TRACK, Mode.HOLD}), Mode.REACT, "A contact of {}: the arm yields to it."),
    Transition(Event.REACTING, _MOVES, Mode.REACT, "Moving with a contact for another {}."),
    Transition(
        Event.CLAMPED,
        _MOVES,
        Mode.HOLD,
        "The arm was clamped between two objects ({}) and has opened along its path: free it, then resume.",
        latches=True,
        soft=True,
    ),
    Transition(Event.OPENING, _MOVES, Mode.REACT, "Clamped between two objects ({}): opening along its path."),
    Transition(Event.YIELDING, _MOVES, Mode.REACT, "Yielding to a contact: the task continues {}."),
    _soft(
        Event.SKIN_UNFIT, "The readings do not fit the skin ({}): give one reading per unit, in the order of the skin."
    ),
    _soft(
        Event.SKIN_SILENT,
        "No usable reading from {}: check the unit's power, radio and sensor; the arm continues when it reports again.",
    ),
    _soft(
        Event.POINTS_LOST,
        "The outside source of points {}: check it and its clock; the arm continues when it reports again.",
    ),
    _soft(Event.MOVING_LOST, "The moving fixtures {}: check their source; the arm continues when it reports again."),
    _soft(Event.LOAD_UNFIT, "The announced payload is {}: announce what the arm carries."),
    _soft(Event.DESIRED_UNFIT, "The desired motion cannot be used ({}): the arm continues with a usable one."),
    _soft(Event.DESIRED_STALE, "The desired motion ended {} ago: the arm continues with a new one."),
    _soft(
        Event.NO_FORCE,
        "The robot has given no force estimate for {}, as near a singularity, and contacts could not be detected:"
        " guide the arm to another posture.",
    ),
    Transition(
        Event.OVERRUN,
        _ANY,
        Mode.HOLD,
        "The last step was {} ago, because this machine is busy, perhaps without a real-time kernel: the arm brakes,"
        " then continues. Close other programs, and give the controller a process of its own.",
    ),
    _soft(Event.GIVEN_UP, "The arm gave up after {}."),
    Transition(
        Event.PRESSED,
        frozenset({Mode.REACT, Mode.HOLD}),
        Mode.HOLD,
        "A force that does not move the arm has been detected for {}: free the arm, or, if nothing touches it, set the"
        " robot's load; the arm continues when the force is gone.",
        soft=True,
    ),
    Transition(
        Event.WINDOW_FILLING,
        _ANY,
        Mode.HOLD,
        "Measuring the arm's torques ({}): contacts cannot be distinguished from noise yet. The arm moves once that"
        " is done.",
    ),
    Transition(Event.CLEAR, _ANY, Mode.TRACK, "Moving as requested."),
)
"""The first row applies whose event is present and whose source contains the mode."""


@dataclass(frozen=True, slots=True)
class ModeState:
    """The mode, and its cause."""

    mode: Mode
    event: Event
    """Cause of the mode; of a HOLD that lasts, the event at its beginning."""
    detail: str = ""
    """Details of this step in the event's sentence."""
    reason: str = ""
    latched: bool = False
    soft: bool = False
    """True if the arm may yield to a push during the HOLD."""


CLEAR = ModeState(Mode.TRACK, Event.CLEAR, reason=TABLE[-1].sentence)


def mode_init() -> ModeState:
    """Return the mode before the first step."""
    return ModeState(Mode.HOLD, Event.WINDOW_FILLING, reason="The controller has not run yet.")


def next_mode(state: ModeState, events: Mapping[Event, str], resume: bool) -> ModeState:
    """Take the first row of the table that applies.

    Args:
        state: the mode so far.
        events: of this step, each with the detail of its sentence.
        resume: whether a person requests to leave a latched HOLD; a cause that persists latches again.
    """
    if not events and not state.latched:
        return CLEAR
    present = {**events, Event.CLEAR: ""}
    if state.latched and not resume:
        present[Event.LATCHED] = ""
    row = next(row for row in TABLE if row.event in present and state.mode in row.source)
    if row.event is Event.LATCHED:
        return state
    detail = present[row.event]
    return ModeState(row.target, row.event, detail, row.sentence.format(detail), row.latches, row.soft)


SOLVED, NOT_FINITE, NOT_CONVEX, BUDGET, INFEASIBLE = range(5)
"""How a minimisation ended."""


class QpOutcome(Enum):
    """How a quadratic program ended."""

    SOLVED = "solved"
    INFEASIBLE = "infeasible"
    """Hard rows contradict the joint box: the answer is the braking command."""
    FAILED = "failed"
    """The solver gave no usable answer: the answer is the braking command."""
    SKIPPED = "skipped"
    """No problem was posed, because the arm holds: the answer is the braking command."""


ENDING = {
    NOT_FINITE: "the problem holds numbers that are not finite",
    NOT_CONVEX: "the Hessian is not convex",
    BUDGET: "the iteration limit was reached",
    INFEASIBLE: "the approach rows cannot be met within the acceleration limits",
}
"""Sentence part by ending of a minimisation, but for `SOLVED`."""


def outcome_of(hold: bool, ending: int, violated: bool) -> tuple[QpOutcome, str, bool]:
    """Return outcome and sentence for how a minimisation ended, and whether its solution violates a soft row."""
    if hold:
        return QpOutcome.SKIPPED, "not posed: the arm holds", False
    if ending != SOLVED:
        return QpOutcome.INFEASIBLE if ending == INFEASIBLE else QpOutcome.FAILED, ENDING[ending], False
    return QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved", violated
