"""The part of `pretouch run` in which the arm moves: to the start of its path, along it, to rest, and the report."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch.arms import OpenedArm
from pretouch.calibration.motion.plan import Plan
from pretouch.errors import HardwareError, PretouchError
from pretouch.loop import MonotonicClock
from pretouch.realtime import Options
from pretouch.session.free_motion import FreeMotion
from pretouch.session.motion import Ending, error_text, follow, go
from pretouch.session.preflight import refusals
from pretouch.session.progress import ProgressReporter
from pretouch.session.run_files import RunFiles, open_run_files
from pretouch.session.session import Session
from pretouch.session.start import check_start
from pretouch.session.terminal import BackgroundPrinter, EnterKey, say
from pretouch.session.units import Units
from pretouch.signals import noted_in_motion
from pretouch.types import ControlStep

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run

_ALIVE_EVERY = 50
"""Control steps between two looks at whether the receiver of the units lives."""


@dataclass(frozen=True)
class PlannedRun:
    """What the arm is going to do."""

    approach: Plan | None
    """To the start of its path, if it goes there first."""
    seconds: float
    """How long it follows the path [s]; infinite until it is stopped."""


def execute(
    command: "Run[Any]",
    session: Session,
    found: OpenedArm,
    way: PlannedRun,
    learnt: FreeMotion | None,
    last: ExitStack,
    write: Callable[[Any], None],
) -> int:
    """Let the arm move and report, whatever ends it; return 1 if it did not end as asked, or else 0.

    All that the run is kept in is opened first. From the report to the end of `last`, signals are only noted.
    """
    controller, enter = session.controller, EnterKey()
    latched = " Press Enter to resume." if enter.possible else " There is no terminal for resuming: end the run."
    place = Path(command.record) if command.record else None
    ending, clock = Ending(), MonotonicClock(controller.limits.period)
    with ExitStack() as stack:
        tell = stack.enter_context(BackgroundPrinter(say))
        further = stack.enter_context(found.output(controller))
        folder = Path(command.holds)
        kept = stack.enter_context(open_run_files(controller, session.arm.name, place, folder, tell, learnt, further))
        reporter = ProgressReporter(kept.recorder, tell, latched, controller)
        known, priority, cpu = learnt.begin if learnt else None, command.priority, command.cpu
        options = Options(enter, known, desired=found.commander or _nobody, priority=priority, cpu=cpu, tell=tell)
        try:
            if _go_to_start(session, way.approach, tell, ending):
                _follow(session, way, reporter, clock, options, ending)
        finally:
            last.enter_context(noted_in_motion())
            tell.close()
            _report(session, reporter, clock, kept, ending, further.notes if further else ())
            write(reporter.summary.numbers(clock.period) | ending.numbers() | {"timing": clock.timing().numbers()})
    return int(ending.early or bool(kept.trouble))


def _nobody() -> None:
    """Ask for nothing: the path is followed."""


def _go_to_start(session: Session, approach: Plan | None, tell: Callable[[str], None], ending: Ending) -> bool:
    """Let the arm go to where its path begins, if it is to; return whether it is there."""
    if approach is None:
        return True
    go(session.arm, session.controller, approach, ending, left_out=session.left_out)
    if not ending.early:
        try:
            ending.stopped = " ".join(refusals(check_start(session.controller, np.array(session.arm.read().q))))
        except PretouchError as error:
            ending.stopped = error_text(error)
    if ending.early:
        ending.stopped = f"The arm did not reach the start of its path. {ending.stopped}"
        return False
    tell("The arm is at the start of its path, and at rest.")
    return True


def _follow(
    session: Session,
    way: PlannedRun,
    reporter: ProgressReporter,
    clock: MonotonicClock,
    options: Options,
    ending: Ending,
) -> None:
    """Let the controller move the arm."""
    until = _Until(way.seconds, session.units)
    try:
        follow(session.controller, session.arm, session.skin, clock, reporter, until, options, ending)
    except PretouchError as error:  # before the arm took the controller's commands
        if way.approach is None:
            raise
        ending.stopped = error_text(error)


def _report(
    session: Session,
    reporter: ProgressReporter,
    clock: MonotonicClock,
    kept: RunFiles,
    ending: Ending,
    notes: tuple[str, ...],
) -> None:
    """Close what the run is kept in, and say how it was."""
    lines = list(ending.sentences())
    if reporter.summary.steps:
        lines += [*reporter.summary.sentences(clock.period), str(clock.timing())]
    lines += [said for said in (session.arm.report(), *notes, *kept.close()) if said]
    say("\n".join(lines))


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
            raise HardwareError("The receiver of the units has ended: see what it printed.")
        return step.stamp - self._begin >= self._seconds
