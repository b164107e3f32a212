"""The command `pretouch run`, in order: checks, guided push, announcement, motion, report."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic

import numpy as np

from pretouch.arms import ArmSetup, OpenedArm, arm_class
from pretouch.calibration.motion.plan import Plan
from pretouch.cli.options import A, ProcessOptions, RobotOptions, SkinOptions, TaskOptions, split_arm
from pretouch.cli.run.setup import free_motion, heard_units, run_setup
from pretouch.cli.warm_up import prepare
from pretouch.cli.writing import check_writable, numbers_to
from pretouch.errors import HardwareError, ParameterError, RecordingError, RobotError
from pretouch.loop import MonotonicClock
from pretouch.realtime import RealTimeOptions, check_wishes
from pretouch.session.may_move import StandingArm, Standstill, refusals, vector
from pretouch.session.memory import ConfirmedRobots, FreeMotion, state_folder
from pretouch.session.progress import ProgressReporter
from pretouch.session.push import Direction, GuidedPush
from pretouch.session.run import Ending, RunFiles, announcement, execute, plan_to_start
from pretouch.session.terminal import BackgroundPrinter, EnterKey, require_yes, say
from pretouch.signals import noted_in_motion


@dataclass(frozen=True)
class UsualOptions(Generic[A]):
    """Move an arm: checks, a guided push that confirms the force sign, the controller in real time, and rest.

    `pretouch run` and `pretouch run simulated` rehearse. `pretouch run NAME` moves another arm, with options of its
    own: franka, ros2 of the distribution pretouch-ros2, or one that another distribution adds.
    `--help-all` also lists the options of the arm's model, the units, files and the process.
    """

    task: TaskOptions
    connection: A


@dataclass(frozen=True)
class Run(UsualOptions[A]):
    """Move an arm; the exit code is 1 if the run ended early or its recording failed, 2 if refused before a motion."""

    robot: RobotOptions
    units: SkinOptions
    process: ProcessOptions

    @staticmethod
    def of_words(words: Sequence[str]) -> tuple[Any, Sequence[str], str]:
        """Return the command for the arm that the first word names, the other words, and what is in front of them."""
        name, others = split_arm(words)
        kind: Any = Run if {"-h", "--help"}.isdisjoint(others) else UsualOptions
        others = ["--help" if word == "--help-all" else word for word in others]
        return kind[arm_class(name)], others, f"run {name}" if len(others) < len(words) else "run"

    def run(self) -> int | None:
        """Move the arm. Where a signal ended the run in order, its code is the exit code."""
        check_options(self)
        with numbers_to(self.process.json) as write:
            return _run(self, write) or None


def check_options(command: Run[Any]) -> None:
    """Raise an error for options that cannot be combined."""
    robot, units, arm = command.robot, command.units, command.connection
    if units.no_skin and (units.skin or units.keys):
        raise HardwareError("--no-skin does not go with --skin and --keys: leave one or the other out.")
    if not (units.no_skin or units.keys or arm.brings_units):
        raise HardwareError("The arm brings no sensor units: give the file of their keys with --keys, or --no-skin.")
    if robot.no_learnt and robot.learnt:
        raise RobotError("--no-learnt does not go with --learnt: leave one or the other out.")
    if not 0.0 <= command.task.seconds < float("inf"):
        raise ParameterError(f"--seconds is {command.task.seconds:g}: give 0 or more.")


def _run(command: Run[Any], write: Callable[[Any], None]) -> int:
    """Move an arm, and write its numbers; return 1 if the run ended early or its recording failed, or else 0."""
    process = command.process
    check_wishes(process.priority, process.cpu)
    if process.record:
        if process.record.exists():
            raise RecordingError(f"{process.record} exists already: give another file to --record.")
        check_writable("recording", process.record)
    setup = run_setup(command.connection, command.robot, command.units, command.task)
    connection = ArmSetup(
        name=command.robot.arm,
        model=setup.model,
        skin=setup.skin,
        units=bool(len(setup.skin)) and not command.units.keys,
        profile=setup.profile,
        start=setup.simulated_start,
        floor=setup.floor,
        priority=process.priority,
        yes=process.yes,
    )
    command.connection.check(connection)
    for sentence in setup.assumed:
        say(sentence)
    prepare(setup.profile)
    with (
        ExitStack() as last,
        command.connection.open(connection) as opened,
        heard_units(command.units, setup.skin, opened) as skin,
    ):
        try:
            remembered = ConfirmedRobots(state_folder())
            # a damaged file is named before anything is checked
            confirmed = opened.identity is not None and remembered.is_confirmed(opened.identity)
            controller = setup.controller(np.array(opened.arm.read().q))
            learnt = free_motion(command.robot, controller, opened.free_motion_id or opened.arm.name)
            clock, approach = MonotonicClock(controller.limits.period), command.task.approach
            standing = StandingArm(opened.arm, skin, controller, setup.floor, clock, approach, opened.left_out)
            notes = opened.notes()
            rest = _checked(standing, notes)
            if confirmed and not command.robot.confirm_push:
                say("The force sign of this robot was confirmed before; --confirm-push repeats it.")
            else:
                _confirm(standing, opened, rest, command.connection.simulated)
                if opened.identity:
                    remembered.add(opened.identity)
                say("The force sign is confirmed: the robot reports the force on the arm, in the base frame.")
            way = _allowed_way(command, standing, opened, rest)
            return _executed(command, standing, opened, way, learnt, notes, last, write)
        finally:
            last.enter_context(noted_in_motion())  # until arm and units are closed


def _checked(standing: StandingArm, notes: Sequence[str]) -> Standstill:
    """Check arm and units, print the findings, and raise a RobotError for those that forbid a run."""
    say(f"{standing.arm.name}: checking it; let it stand still and do not touch it.")
    rest, findings = standing.check()
    for note in (*notes, *(finding.sentence for finding in findings if finding.level == "warning")):
        say(f"Mind: {note}")
    refused = refusals(findings)
    if refused:
        raise RobotError("The arm is not moved:\n" + "\n".join(f"  {sentence}" for sentence in refused))
    say(f"All checks passed. Force at rest: {vector(rest.rest_wrench[:3])} N.")
    return rest


def _confirm(standing: StandingArm, opened: OpenedArm, rest: Standstill, simulated: bool) -> None:
    """Confirm the force sign by guided pushes, of a person or a simulated one."""
    push = "A simulated person pushes the hand" if simulated else "Push the hand gently"

    def ask(direction: Direction) -> None:
        say(f"{push}, with about 15 N and for a second, towards {direction.words}.")
        opened.push(direction)

    GuidedPush(standing.arm, standing.clock, standing.controller.model, ask, say).confirm(rest)


def _allowed_way(command: Run[Any], standing: StandingArm, opened: OpenedArm, rest: Standstill) -> Plan | None:
    """Announce the motion, and ask; return the plan to the start of the path, if the arm goes there first.

    Before and after, the arm must stand where it was checked.
    """
    c, q = standing.controller, standing.recheck(rest)
    way = plan_to_start(c.model, q, c.path, standing.floor) if standing.approach else None
    for sentence in announcement(c, command.task.seconds or np.inf, way, opened.announced):
        say(sentence)
    if not command.process.yes:
        require_yes("Go on?", "The arm was not moved")
    standing.recheck(rest)
    return way


def _executed(
    command: Run[Any],
    standing: StandingArm,
    opened: OpenedArm,
    way: Plan | None,
    learnt: FreeMotion | None,
    notes_before: Sequence[str],
    last: ExitStack,
    write: Callable[[Any], None],
) -> int:
    """Move the arm and report, whatever ends it; return 1 if it did not end as requested, or else 0.

    All files of the run are opened first. From the report to the end of `last`, signals are only noted.
    """
    controller, enter = standing.controller, EnterKey()
    latched = " Press Enter to resume." if enter.possible else " There is no terminal for resuming: end the run."
    ending, clock = Ending(), MonotonicClock(controller.limits.period)
    with ExitStack() as stack:
        tell = stack.enter_context(BackgroundPrinter(say))
        output = stack.enter_context(opened.output(controller))
        opening = RunFiles(standing, command.process.record, Path(command.process.holds), tell, learnt, output)
        files = stack.enter_context(opening)
        reporter = ProgressReporter(files, tell, latched, controller)
        options = RealTimeOptions(
            enter,
            learnt.begin if learnt else None,
            desired=opened.commander or (lambda: None),
            priority=command.process.priority,
            cpu=command.process.cpu,
            tell=tell,
        )
        try:
            execute(standing, way, command.task.seconds or np.inf, reporter, clock, options, ending)
        finally:
            last.enter_context(noted_in_motion())
            tell.close()
            lines = list(ending.sentences())
            if reporter.summary.steps:
                lines += [*reporter.summary.sentences(clock.period), str(clock.timing())]
            notes = [note for note in opened.notes() if note not in notes_before]
            lines += filter(None, (standing.arm.report(), *notes, *(output.notes if output else ()), *files.close()))
            say("\n".join(lines))
            write({"summary": reporter.summary, "ending": ending, "timing": clock.timing()})
    return int(ending.early or bool(files.trouble))
