"""The arm moves: slowly to where its path begins, then under the controller. However it ends, it is to end at rest."""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from pretouch import loop, realtime
from pretouch.calibration.motion.follow import PlanCommander, plan_controller
from pretouch.calibration.motion.plan import Plan
from pretouch.controller import Controller
from pretouch.errors import PretouchError
from pretouch.loop import MonotonicClock, Recorder
from pretouch.ports import Arm, Skin
from pretouch.session.run_files import RecorderGroup
from pretouch.session.session import NoUnits
from pretouch.signals import noted_in_motion
from pretouch.types import ControlStep


@dataclass
class Ending:
    """How a motion ended: written as it does, to be read whatever is raised then."""

    stopped: str = ""
    """Why it ended early, as a sentence; '' if it did not."""
    rest_unknown: str = ""
    """Why the arm may not be at rest, as a sentence; '' if it is."""

    @property
    def early(self) -> bool:
        """Whether it did not end as asked."""
        return bool(self.stopped or self.rest_unknown)

    def numbers(self) -> dict[str, str | None]:
        """Return it for JSON."""
        return {"ended_early": self.stopped or None, "rest_unknown": self.rest_unknown or None}

    def sentences(self) -> tuple[str, ...]:
        """Say it."""
        rest = "The arm is at rest."
        if self.rest_unknown:
            rest = f"The arm may not be at rest: {self.rest_unknown} Check it, and press the user stop."
        return (rest, f"The run ended early: {self.stopped}") if self.stopped else (rest,)


_STAND_S, _LOOK_S = 1.0, 0.01
"""How long an arm is looked at, and between two looks [s]."""
_STILL_RAD_S = 0.05
"""Six standard deviations of the joint velocity that a Panda measures at rest [rad/s]."""
NO_RECORDER = RecorderGroup(())


def go(
    arm: Arm,
    controller: Controller,
    way: Plan,
    ending: Ending,
    recorder: Recorder = NO_RECORDER,
    left_out: Callable[[], float] = lambda: 0.0,
) -> None:
    """Let an arm follow a plan, without a skin. A signal stops it, and is raised after it has come to rest.

    What the arm follows, and what ends it early, is `calibration.motion.follow`'s. `controller` gives arm and rate,
    `left_out` the time that this machine was too slow to simulate the arm so far [s].
    """
    blind = plan_controller(controller.model, np.array(arm.read().q), controller.profile)
    realtime.warm_up(blind, arm.read())
    commander = PlanCommander(blind, way, time.monotonic, left_out)

    def move(came: list[int]) -> str:
        def done(step: ControlStep) -> bool:
            return bool(came) or commander.done(step)

        clock, options = MonotonicClock(blind.limits.period), loop.Options(desired=commander)
        with realtime.real_time():
            loop.run(blind, arm, NoUnits(), clock, recorder, done, options)
        return "A signal came." if came else commander.stopped

    _run_motion(arm, move, ending)


def follow(
    controller: Controller,
    arm: Arm,
    skin: Skin,
    clock: MonotonicClock,
    recorder: Recorder,
    done: Callable[[ControlStep], bool],
    options: realtime.Options,
    ending: Ending,
) -> None:
    """Turn the controller until `done` says so, a signal comes, or something fails. The arguments are `realtime.run`'s.

    Everything is compiled before the arm takes commands. A signal is raised after the arm has come to rest.
    """
    realtime.warm_up(controller, arm.read())

    def move(came: list[int]) -> str:
        realtime.run(controller, arm, skin, clock, recorder, lambda step: bool(came) or done(step), options)
        return ""

    _run_motion(arm, move, ending)


def _run_motion(arm: Arm, move: Callable[[list[int]], str], ending: Ending) -> None:
    """Let an arm take commands while `move` gives them; it is handed the signals that came, and says why it stopped."""
    with noted_in_motion() as came:
        try:
            arm.begin()
            ending.stopped = move(came)
        except Exception as error:
            ending.stopped = error_text(error)
        finally:
            try:
                arm.end()
            except Exception as error:
                ending.stopped = ending.stopped or error_text(error)
                ending.rest_unknown = "" if _is_at_rest(arm) else error_text(error)


def _is_at_rest(arm: Arm) -> bool:
    """Whether an arm whose motion could not be ended is seen to stand, as after a stop of its own."""
    begin = time.monotonic()
    while time.monotonic() < begin + _STAND_S:
        with suppress(Exception):  # whatever it is, the arm is not seen to stand
            state = arm.read()
            if state.stamp > begin and np.abs(state.qd).max() < _STILL_RAD_S:
                return True
        time.sleep(_LOOK_S)
    return False


def error_text(error: Exception) -> str:
    """Say what an error says, and of one that is not ours, what it is."""
    return str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
