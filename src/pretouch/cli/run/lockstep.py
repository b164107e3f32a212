"""What `pretouch run --lockstep` does: a simulated Franka arm on this machine, which waits for each command."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pretouch.cli.run.setup import RunSetup, free_motion
from pretouch.cli.skin_keys import keys_file
from pretouch.errors import RobotError
from pretouch.hardware.franka.client import connect, demand_answer
from pretouch.hardware.franka.collision import collision_behavior
from pretouch.hardware.franka.errors import MotionAborted
from pretouch.hardware.franka.lockstep import LockstepSkin, run_in_lockstep
from pretouch.hardware.keys import load_keys
from pretouch.session.motion import Ending, error_text
from pretouch.session.preflight import refusals
from pretouch.session.progress import ProgressReporter
from pretouch.session.run_files import open_run_files
from pretouch.session.session import NoUnits
from pretouch.session.start import check_start
from pretouch.session.terminal import say
from pretouch.types import ControlStep, RangeReadings

if TYPE_CHECKING:
    from pretouch.cli.run.options import Run


def run_lockstep(command: "Run", setup: RunSetup, write: Callable[[Any], None]) -> int:
    """Let a controller move a simulated arm that waits for it, and write the numbers; return 1 if that ended early.

    Nobody is asked anything: nothing is real.
    """
    address, seconds = command.robot.ip, command.task.seconds
    demand_answer(address)
    with connect(address, command.robot.kind) as client, _units(command, setup) as readings_at:
        client.set_collision_behavior(collision_behavior(setup.profile, setup.model))
        q = client.read().q
        controller = setup.controller(q)
        refused = refusals(check_start(controller, q))
        if refused:
            raise RobotError(refused[0])
        say("In lockstep the arm is simulated, so there are no checks and no guided push.")
        place, folder = Path(command.record) if command.record else None, Path(command.holds)
        name, ending = f"{command.robot.arm} at {address}, in lockstep", Ending()
        learnt = free_motion(command.robot, controller, name, remembered=False)  # runs alike are to stay alike
        with open_run_files(controller, name, place, folder, say, learnt) as kept:
            reporter = ProgressReporter(kept.recorder, say, "", controller)
            try:
                until, begin = _Until(seconds), learnt.begin if learnt else None
                run_in_lockstep(client, controller, readings_at, reporter, until, learnt=begin)
            except Exception as error:
                ending = _ended(error)
                if not reporter.summary.steps:
                    raise
            finally:
                said = (*reporter.summary.sentences(controller.limits.period), *kept.close())
                say("\n".join((*ending.sentences(), *said)))
                write(reporter.summary.numbers(controller.limits.period) | ending.numbers())
    return int(ending.early or bool(kept.trouble))


def _ended(error: Exception) -> Ending:
    """Return how a motion ended by an error: a connection that was lost tells nothing of the arm."""
    lost = isinstance(error, MotionAborted) and not error.errors
    return Ending(error_text(error), error_text(error) if lost else "")


@contextmanager
def _units(command: "Run", setup: RunSetup) -> Iterator[Callable[[float], RangeReadings]]:
    """Hear the units in the robot's time, if there are any."""
    if not len(setup.skin):
        nothing = NoUnits().read()
        yield lambda _: nothing
        return
    c = command.units
    with LockstepSkin(setup.skin, load_keys(keys_file(c.keys)), c.units_host, c.units_port, command.seed) as skin:
        yield skin


class _Until:
    """Whether so many seconds of robot time have passed since the first step."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._begin = seconds, np.nan

    def __call__(self, step: ControlStep) -> bool:
        self._begin = step.stamp if np.isnan(self._begin) else self._begin
        return step.stamp - self._begin >= self._seconds
