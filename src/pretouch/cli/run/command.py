"""What `pretouch run` does, in order: checks, guided push, announcement, motion, report."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch.arms import OpenedArm
from pretouch.cli.run.motion import PlannedRun, execute
from pretouch.cli.run.setup import RunSetup, free_motion, heard_units, run_setup
from pretouch.cli.warm_up import prepare
from pretouch.cli.writing import check_writable
from pretouch.errors import RecordingError, RobotError
from pretouch.loop import MonotonicClock
from pretouch.ports import Skin
from pretouch.realtime import check_wishes
from pretouch.session.confirmations import ConfirmedRobots, state_folder
from pretouch.session.preflight import PreflightParams, refusals
from pretouch.session.push import Direction, GuidedPush, PushParams
from pretouch.session.session import Session
from pretouch.session.standstill import Standstill
from pretouch.session.start import announcement, plan_to_start
from pretouch.session.terminal import require_yes, say
from pretouch.session.units import Units
from pretouch.signals import noted_in_motion

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run

PREFLIGHT, PUSH = PreflightParams(), PushParams()
"""What arm and pushes must be like."""


def run(command: "Run[Any]", write: Callable[[Any], None]) -> int:
    """Move an arm, and write its numbers; return 1 if the run ended early or its recording failed, or else 0."""
    check_wishes(command.priority, command.cpu)
    if command.record:
        _check_free(command.record)
    made = run_setup(command)
    setup = made.of_arm(command)
    command.connection.check(setup)
    for sentence in made.assumed:
        say(sentence)
    prepare(made.profile)
    with (
        ExitStack() as last,
        command.connection.open(setup) as found,
        heard_units(command.units, made.skin, found) as (skin, units),
    ):
        try:
            return _run(command, made, found, (skin, units), last, write)
        finally:
            last.enter_context(noted_in_motion())  # until arm and units are closed


def _run(
    command: "Run[Any]",
    made: RunSetup,
    found: OpenedArm,
    heard: tuple[Skin, Units | None],
    last: ExitStack,
    write: Callable[[Any], None],
) -> int:
    """Check, ask, and let the arm move; see `execute`."""
    remembered = ConfirmedRobots(state_folder())
    known = found.identity is not None and remembered.is_confirmed(found.identity)  # a damaged file is found out first
    controller = made.controller(np.array(found.arm.read().q))
    clock = MonotonicClock(made.profile.task.control_period_s)
    learnt = free_motion(command.robot, controller, found.free_motion_id or found.arm.name)
    session = Session(found.arm, *heard, controller, made.floor, clock, found.left_out)
    say(f"{found.arm.name}: checking it; let it stand still and do not touch it.")
    rest = _checked(session, command.task.approach, found.notes())
    if known and not command.robot.confirm_push:
        say("The force sign of this robot was confirmed before; --confirm-push repeats it.")
    else:
        _confirm(session, found, rest)
        if found.identity:
            remembered.keep(found.identity)
        say("The force sign is confirmed: the robot reports the force on the arm, in the base frame.")
    asks = found.commander.announced if found.commander else ""
    return execute(command, session, found, _confirm_motion(command, session, made, rest, asks), learnt, last, write)


def _checked(session: Session, approach: bool, notes: Sequence[str]) -> Standstill:
    """Check arm and units, print what was found, and raise RobotError for what forbids a run."""
    rest, findings = session.preflight(PREFLIGHT, approach)
    for note in (*notes, *(finding.sentence for finding in findings if not finding.refused)):
        say(f"Mind: {note}")
    refused = refusals(findings)
    if refused:
        raise RobotError("The arm is not moved:\n" + "\n".join(f"  {sentence}" for sentence in refused))
    say(f"All checks passed. Force at rest: {_vector(rest.rest_wrench[:3])} N.")
    return rest


def _confirm(session: Session, found: OpenedArm, rest: Standstill) -> None:
    """Have the force sign confirmed by guided pushes."""

    def ask(direction: Direction) -> None:
        say(f"Push the hand gently, with about 15 N and for a second, towards {direction.words}.")
        found.push(direction)

    GuidedPush(session.arm, session.clock, session.controller.model, ask, say, PUSH).confirm(rest)


def _confirm_motion(command: "Run[Any]", session: Session, made: RunSetup, rest: Standstill, asks: str) -> PlannedRun:
    """Say what the arm will do, and ask; return it if the arm may do it, and stands where it was checked."""
    approach = command.task.approach
    q = session.recheck(rest, PREFLIGHT, approach)
    way = PlannedRun(
        plan_to_start(made.model, q, session.controller.path, made.floor) if approach else None,
        command.task.seconds or np.inf,
    )
    for sentence in announcement(session.controller, way.seconds, way.approach, asks):
        say(sentence)
    if not command.yes:
        require_yes("Go on?", "The arm was not moved")
    session.recheck(rest, PREFLIGHT, approach)
    return way


def _check_free(place: Path) -> None:
    """Raise an error where no recording can be written; a folder that is made for it is said."""
    if place.exists():
        raise RecordingError(f"{place} exists already: give another file to --record.")
    missing = not place.parent.exists()
    check_writable("recording", place)
    if missing:
        say(f"The folder {place.parent} was created for the recording.")


def _vector(values: np.ndarray) -> str:
    return f"({', '.join(f'{value:.1f}' for value in values)})"
