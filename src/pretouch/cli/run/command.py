"""What `pretouch run` does, in order: checks, guided push, announcement, motion, report."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pretouch.cli.run.asking import demand_yes, say
from pretouch.cli.run.learnt import free_motion
from pretouch.cli.run.moving import Way, moved
from pretouch.cli.run.opened import Opened
from pretouch.cli.run.parts import Parts, parts
from pretouch.cli.run.robots import need_extra, opened
from pretouch.cli.writing import check_writable
from pretouch.errors import RecordingError, RobotError
from pretouch.loop import MonotonicClock
from pretouch.realtime import check_wishes
from pretouch.session.announce import announcement
from pretouch.session.finding import refusals
from pretouch.session.preflight import PreflightParams
from pretouch.session.push import Direction, GuidedPush, PushParams
from pretouch.session.remembered import Remembered, state_folder
from pretouch.session.session import Session
from pretouch.session.standing import Standing
from pretouch.session.start import way_to_start
from pretouch.signals import noted_in_motion

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run

PREFLIGHT, PUSH = PreflightParams(), PushParams()
"""What arm and pushes must be like."""


def run(command: "Run") -> int:
    """Move an arm; return 1 if the run ended early or its recording failed, or else 0."""
    check_wishes(command.priority, command.cpu)
    if command.record:
        _check_free(Path(command.record))
    made = parts(command)
    need_extra(command)
    if command.robot.lockstep:
        from pretouch.cli.run.lockstep import run_lockstep

        return run_lockstep(command, made)
    with ExitStack() as last, opened(command, made) as found:
        try:
            return _run(command, made, found, last)
        finally:
            last.enter_context(noted_in_motion())  # until arm and units are closed


def _run(command: "Run", made: Parts, found: Opened, last: ExitStack) -> int:
    """Check, ask, and let the arm move; see `moved`."""
    remembered = Remembered(state_folder())
    known = found.identity is not None and remembered.knows(found.identity)  # a damaged file is found out first
    controller = made.controller(np.array(found.arm.read().q))
    clock = MonotonicClock(made.profile.task.control_period_s)
    learnt = free_motion(command.robot, controller, found.learnt_as)
    session = Session(found.arm, found.skin, found.units, controller, made.floor, clock)
    say(f"{found.arm.name}: checks, while it stands still and nobody touches it.")
    rest = _checked(session, command.task.approach, found.notes())
    if known and not command.robot.confirm_push:
        say("The force sign of this robot was confirmed before; --confirm-push does it again.")
    else:
        _confirm(session, found, rest)
        if found.identity:
            remembered.keep(found.identity)
        say("The force sign is confirmed: force on the arm, base frame.")
    return moved(command, session, found, _allowed(command, session, made, rest), learnt, last)


def _checked(session: Session, approach: bool, notes: Sequence[str]) -> Standing:
    """Check arm and units, print what was found, and raise RobotError for what forbids a run."""
    rest, findings = session.preflight(PREFLIGHT, approach)
    for note in (*notes, *(finding.sentence for finding in findings if not finding.refused)):
        say(f"Mind: {note}")
    refused = refusals(findings)
    if refused:
        raise RobotError("The arm is not moved:\n" + "\n".join(f"  {sentence}" for sentence in refused))
    say(f"All checks passed. Force at rest: {_vector(rest.rest_wrench[:3])} N.")
    return rest


def _confirm(session: Session, found: Opened, rest: Standing) -> None:
    """Have the force sign confirmed by guided pushes."""

    def ask(direction: Direction) -> None:
        say(f"Push the hand gently, with about 15 N and for a second, towards {direction.words}.")
        found.asked(direction)

    GuidedPush(session.arm, session.clock, session.controller.model, ask, say, PUSH).confirm(rest)


def _allowed(command: "Run", session: Session, made: Parts, rest: Standing) -> Way:
    """Say what the arm will do, and ask; return it if the arm may do it, and stands where it was checked."""
    approach = command.task.approach
    q = session.recheck(rest, PREFLIGHT, approach)
    way = Way(
        way_to_start(made.model, q, session.controller.path, made.floor) if approach else None,
        command.task.seconds or np.inf,
    )
    for sentence in announcement(session.controller, way.seconds, way.approach):
        say(sentence)
    if not command.yes:
        demand_yes("Go on?", "The arm was not moved")
    session.recheck(rest, PREFLIGHT, approach)
    return way


def _check_free(place: Path) -> None:
    """Raise an error where no recording can be written; a folder that is made for it is said."""
    if place.exists():
        raise RecordingError(f"{place} is there already: give another file to --record.")
    missing = not place.parent.exists()
    check_writable("recording", place)
    if missing:
        say(f"The folder {place.parent} was made for the recording.")


def _vector(values: np.ndarray) -> str:
    return f"({', '.join(f'{value:.1f}' for value in values)})"
