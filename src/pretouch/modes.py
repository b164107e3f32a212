"""What the arm is doing and why: one transition table, with a sentence for each reason; how a program ends."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum


class Mode(Enum):
    """What the arm is doing."""

    TRACK = "track"
    """Follow the path, slowed and restricted near obstacles."""
    REACT = "react"
    """Yield to a contact (eq. 12)."""
    HOLD = "hold"
    """Brake within limits, stand still, and say why."""


class Event(Enum):
    """What can make the mode change, seen in one control step."""

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
    """Whether the HOLD lasts until a person resumes."""
    soft: bool = False
    """Whether the arm may yield to a push while it holds: not where state, time or answer cannot be trusted."""


_ANY = frozenset(Mode)

TABLE: tuple[Transition, ...] = (
    Transition(
        Event.UNUSABLE, _ANY, Mode.HOLD,
        "The robot's state cannot be used ({}): check the connection to the arm, then resume.",
        latches=True,
    ),
    Transition(
        Event.TIME_BACKWARDS, _ANY, Mode.HOLD,
        "Time went backwards ({}): let one monotonic clock stamp everything, then resume.", latches=True,
    ),
    Transition(
        Event.STATE_STALE, _ANY, Mode.HOLD,
        "The robot's state is {}, then resume.", latches=True,
    ),
    Transition(
        Event.SOLVER_FAILED, _ANY, Mode.HOLD,
        "The quadratic program gave no answer ({}): look at the last steps, then resume.", latches=True,
    ),
    Transition(
        Event.BLOCKED, frozenset({Mode.TRACK}), Mode.HOLD,
        "The approach limits cannot be met within the acceleration limits: braking and trying again.",
    ),
    Transition(
        Event.BLOCKED, frozenset({Mode.REACT}), Mode.REACT,
        "Moving with a contact, but the approach limits allow no motion within the acceleration limits: braking.",
    ),
    Transition(Event.LATCHED, frozenset({Mode.HOLD}), Mode.HOLD, "as before", latches=True),
    Transition(
        Event.CONTACT, frozenset({Mode.TRACK, Mode.HOLD}), Mode.REACT,
        "A contact of {}: yielding to what moves the arm.",
    ),
    Transition(Event.REACTING, frozenset({Mode.REACT}), Mode.REACT, "Moving with a contact: {} left."),
    Transition(
        Event.CLAMPED, frozenset({Mode.REACT}), Mode.HOLD,
        "The arm was clamped between two objects ({}) and has opened the way it came: free it, then resume.",
        latches=True, soft=True,
    ),
    Transition(
        Event.OPENING, frozenset({Mode.REACT}), Mode.REACT,
        "Clamped between two objects ({}): opening the way it came.",
    ),
    Transition(
        Event.YIELDING, frozenset({Mode.REACT}), Mode.REACT, "Yielding to a contact: the task goes on {}.",
    ),
    Transition(
        Event.SKIN_UNFIT, _ANY, Mode.HOLD,
        "The readings do not fit the skin ({}): give one of each unit, in the order of the skin.",
        soft=True,
    ),
    Transition(
        Event.SKIN_SILENT, _ANY, Mode.HOLD,
        "No usable reading from {}: check the unit's power, radio and sensor; the arm goes on when it is heard again.",
        soft=True,
    ),
    Transition(
        Event.POINTS_LOST, _ANY, Mode.HOLD,
        "The outside source of points {}: check it and its clock; the arm goes on when it is heard again.",
        soft=True,
    ),
    Transition(
        Event.MOVING_LOST, _ANY, Mode.HOLD,
        "The fixtures that move {}: check who tells of them; the arm goes on when it is told again.",
        soft=True,
    ),
    Transition(
        Event.LOAD_UNFIT, _ANY, Mode.HOLD, "The announced payload is {}: announce what the arm carries.", soft=True,
    ),
    Transition(
        Event.DESIRED_UNFIT, _ANY, Mode.HOLD,
        "The desired motion cannot be used ({}): the arm goes on when it can.", soft=True,
    ),
    Transition(
        Event.DESIRED_STALE, _ANY, Mode.HOLD,
        "The desired motion ended {} ago: the arm goes on when a new one comes.", soft=True,
    ),
    Transition(
        Event.NO_FORCE, _ANY, Mode.HOLD,
        "The robot has given no force estimate for {}, as near a singularity, and contacts could not be detected:"
        " guide the arm to another posture.",
        soft=True,
    ),
    Transition(
        Event.OVERRUN, _ANY, Mode.HOLD,
        "The step before this one was {} ago, for this machine is busy, perhaps without a real-time kernel: braking,"
        " then going on. Close other programs, and give the controller a process of its own.",
    ),
    Transition(Event.GIVEN_UP, _ANY, Mode.HOLD, "Given up after {}.", soft=True),
    Transition(
        Event.PRESSED, frozenset({Mode.REACT, Mode.HOLD}), Mode.HOLD,
        "A force that does not move the arm has been detected for {}: free the arm, or, if nothing touches it, set the"
        " robot's load; the arm continues when the force is gone.",
        soft=True,
    ),
    Transition(
        Event.WINDOW_FILLING, _ANY, Mode.HOLD,
        "The force window is filling ({}): contacts cannot be distinguished from noise yet. The arm moves"
        " once it is full.",
    ),
    Transition(Event.CLEAR, _ANY, Mode.TRACK, "Moving as asked."),
)  # fmt: skip
"""Read from the top: the first row whose event is present and whose source holds the mode is taken."""


@dataclass(frozen=True, slots=True)
class ModeState:
    """The mode, and why."""

    mode: Mode
    event: Event
    """What made it so; of a HOLD that lasts, what began it."""
    detail: str = ""
    """What the event's sentence says of this step."""
    reason: str = ""
    latched: bool = False
    soft: bool = False
    """Whether the arm may yield to a push while it holds."""


CLEAR = ModeState(Mode.TRACK, Event.CLEAR, reason=TABLE[-1].sentence)


def mode_init() -> ModeState:
    """Return the mode before the first step."""
    return ModeState(Mode.HOLD, Event.WINDOW_FILLING, reason="The controller has not run yet.")


def next_mode(state: ModeState, events: Mapping[Event, str], resume: bool) -> ModeState:
    """Take the first row of the table that applies.

    Args:
        state: the mode so far.
        events: what this step saw, each with the detail its sentence needs.
        resume: whether a person asks to leave a latched HOLD; a cause that is still there latches again.
    """
    if not events and not state.latched:
        return CLEAR
    seen = {**events, Event.CLEAR: ""}
    if state.latched and not resume:
        seen[Event.LATCHED] = ""
    row = next(row for row in TABLE if row.event in seen and state.mode in row.source)
    if row.event is Event.LATCHED:
        return state
    detail = seen[row.event]
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
"""What happened, by how a minimisation ended, but for `SOLVED`."""


def outcome_of(hold: bool, ending: int, violated: bool) -> tuple[QpOutcome, str, bool]:
    """Return outcome and sentence for how a minimisation ended, and whether its solution violates a soft row."""
    if hold:
        return QpOutcome.SKIPPED, "not posed: the arm holds", False
    if ending != SOLVED:
        return QpOutcome.INFEASIBLE if ending == INFEASIBLE else QpOutcome.FAILED, ENDING[ending], False
    return QpOutcome.SOLVED, "solved, an approach row is violated" if violated else "solved", violated
