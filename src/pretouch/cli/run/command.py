"""What `pretouch run` does, in order: checks, guided push, announcement, motion, report."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from pretouch.calibration.motion.plan import Plan
from pretouch.cli.run.options import Run, check_options
from pretouch.cli.run.parts import Parts, parts
from pretouch.cli.run.robots import Opened, opened
from pretouch.cli.writing import check_writable
from pretouch.errors import HardwareError, RecordingError, RobotError
from pretouch.loop import MonotonicClock
from pretouch.realtime import check_wishes
from pretouch.session.announce import announcement
from pretouch.session.finding import refusals
from pretouch.session.keeping import Kept, keeping
from pretouch.session.motion import Ending, Wishes, follow, go
from pretouch.session.preflight import PreflightParams
from pretouch.session.push import Direction, GuidedPush, PushParams
from pretouch.session.remembered import Remembered, state_folder
from pretouch.session.session import Session
from pretouch.session.standing import Standing
from pretouch.session.start import check_start, way_to_start
from pretouch.session.terminal import EnterKey, Narrator
from pretouch.session.units import Units
from pretouch.session.watching import Watcher
from pretouch.types import ControlStep

PREFLIGHT, PUSH = PreflightParams(), PushParams()
"""What arm and pushes must be like."""
_ALIVE_EVERY = 50
"""Control steps between two looks at whether the receiver of the units lives."""


def run(command: Run) -> int:
    """Move an arm; return 1 if the run ended early, or else 0."""
    check_options(command)
    check_wishes(command.priority, command.cpu)
    if command.record:
        _check_free(Path(command.record))
    made = parts(command)
    if command.robot.lockstep:
        from pretouch.cli.run.lockstep import run_lockstep

        return run_lockstep(command, made)
    with opened(command, made) as found:
        controller = made.controller(np.array(found.arm.read().q))
        clock = MonotonicClock(made.profile.task.control_period_s)
        session = Session(found.arm, found.skin, found.units, controller, made.floor, clock)
        _say(f"{found.arm.name}: checks, while it stands still and nobody touches it.")
        rest = _checked(session, command.task.approach, found.notes())
        _confirm(command, session, found, rest)
        return _moved(command, session, made, found)


def _checked(session: Session, approach: bool, notes: Sequence[str]) -> Standing:
    """Check arm and units, print what was found, and raise RobotError for what forbids a run."""
    rest, findings = session.preflight(PREFLIGHT, approach)
    for note in (*notes, *(finding.sentence for finding in findings if not finding.refused)):
        _say(f"Mind: {note}")
    refused = refusals(findings)
    if refused:
        raise RobotError("The arm is not moved:\n" + "\n".join(f"  {sentence}" for sentence in refused))
    _say(f"All checks passed. Force at rest: {_vector(rest.rest_wrench[:3])} N.")
    return rest


def _confirm(command: Run, session: Session, found: Opened, rest: Standing) -> None:
    """Have the force sign confirmed by guided pushes, unless it has been."""
    remembered, identity = Remembered(state_folder()), found.identity
    if identity and not command.robot.confirm_push and remembered.knows(identity):
        _say("The force sign of this robot was confirmed before; --confirm-push does it again.")
        return

    def ask(direction: Direction) -> None:
        _say(f"Push the hand gently, with about 15 N and for a second, towards {direction.words}.")
        found.asked(direction)

    model = session.controller.model
    GuidedPush(session.arm, session.clock, model, ask, _say, PUSH).confirm(rest)
    if identity:
        remembered.keep(identity)
    _say("The force sign is confirmed: force on the arm, base frame.")


def _moved(command: Run, session: Session, made: Parts, found: Opened) -> int:
    """Say what the arm will do, ask, and do it."""
    controller, arm = session.controller, session.arm
    q = np.array(arm.read().q)
    way = way_to_start(made.model, q, controller.path, made.floor) if command.task.approach else None
    seconds = command.task.seconds or np.inf
    for sentence in announcement(controller, seconds, way):
        _say(sentence)
    if not command.yes:
        _ask()
    session.check_arm()
    if way is not None:
        _gone(session, way)
    return _followed(command, session, found, seconds)


def _gone(session: Session, way: Plan) -> None:
    """Let the arm go to where its path begins; RobotError if it does not get there."""
    ending = Ending()
    try:
        go(session.arm, session.controller, way, ending)
    finally:
        _say(_rest(ending))
    if ending.stopped or ending.unrest:
        raise RobotError(f"The arm did not get to the start of its path. {ending.stopped}")
    refused = refusals(check_start(session.controller, np.array(session.arm.read().q)))
    if refused:
        raise RobotError(refused[0])


def _ask() -> None:
    """Have a person let the arm move; RobotError if none does."""
    if not sys.stdin.isatty():
        raise RobotError("There is no terminal to ask at whether the arm may move: give --yes.")
    if input("Go on? [y/N] ").strip().lower() not in ("y", "yes"):
        raise RobotError("The arm was not moved: answer y to let it.")


def _followed(command: Run, session: Session, found: Opened, seconds: float) -> int:
    """Let the controller move the arm, and report, whatever ends it."""
    controller, enter = session.controller, EnterKey()
    latched = " Press Enter to resume." if enter.possible else " There is no terminal to resume at: end the run."
    wishes, ending = Wishes(command.priority, command.cpu), Ending()
    place = Path(command.record) if command.record else None
    with ExitStack() as stack:
        tell = stack.enter_context(Narrator(_say))
        further = stack.enter_context(found.output(controller))
        kept = stack.enter_context(keeping(controller, session.arm.name, place, Path(command.holds), further))
        watcher = Watcher(kept.recorder, tell, latched, controller.limits.period)
        until, clock = _Until(seconds, session.units), MonotonicClock(controller.limits.period)
        try:
            follow(session.arm, session.skin, controller, clock, watcher, until, enter, wishes, tell, ending)
        finally:
            tell.close()
            _report(session, watcher, clock, kept, ending)
    return int(bool(ending.stopped or ending.unrest))


def _report(session: Session, watcher: Watcher, clock: MonotonicClock, kept: Kept, ending: Ending) -> None:
    lines = [_rest(ending)]
    lines += [f"The run ended early: {ending.stopped}"] if ending.stopped else []
    lines += watcher.course.sentences(clock.period)
    lines += [said for said in (str(clock.timing()), session.arm.report(), *kept.close()) if said]
    _say("\n".join(lines))


def _rest(ending: Ending) -> str:
    if ending.unrest:
        return f"Whether the arm is at rest is not known: {ending.unrest} Look at it, and press the user stop."
    return "The arm is at rest."


class _Until:
    """When a run is over."""

    def __init__(self, seconds: float, units: Units | None) -> None:
        self._seconds, self._units = seconds, units
        self._begin, self._steps = 0.0, 0

    def __call__(self, step: ControlStep) -> bool:
        """Whether this step was the last; a receiver that has ended is a HardwareError."""
        self._begin = self._begin if self._steps else step.stamp
        self._steps += 1
        if self._units and self._steps % _ALIVE_EVERY == 0 and not self._units.alive:
            raise HardwareError("The receiver of the units has ended: what it printed tells why.")
        return step.stamp - self._begin >= self._seconds


def _say(sentence: str) -> None:
    print(sentence, flush=True)


def _check_free(place: Path) -> None:
    if place.exists():
        raise RecordingError(f"{place} is there already: give another file to --record.")
    check_writable("recording", place)


def _vector(values: np.ndarray) -> str:
    return f"({', '.join(f'{value:.1f}' for value in values)})"
