"""Motion of the arm: slowly to the start of its path, then under the controller. Each end tries to bring it to rest."""

import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from pretouch import loop, realtime
from pretouch.calibration.motion.follow import PlanCommander, plan_controller
from pretouch.calibration.motion.limits import PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.planner import approach
from pretouch.control.path import Path as ArmPath
from pretouch.controller import Controller
from pretouch.errors import CalibrationError, ExperimentError, HardwareError, PretouchError, RobotError
from pretouch.loop import Cycle, MonotonicClock, Recorder
from pretouch.ports import Arm, NoUnits, SkinPort
from pretouch.recording.writer import LastSeconds, Recording
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.session.may_move import StandingArm, check_start, refusals, vector
from pretouch.session.memory import FreeMotion
from pretouch.signals import noted_in_motion
from pretouch.types import ControlStep, FloatArray
from pretouch.units.skin import NetworkSkin

_SPEED_M_S = 0.15
_SHARE = 0.2
"""Share of the joints' limits that is used on the way to the start."""
_PLACES = 200
"""Places of the path, for the room that it takes."""
_STAND_S, _LOOK_S = 1.0, 0.01
"""How long an arm is looked at, and between two looks [s]."""
_STILL_RAD_S = 0.05
"""Six standard deviations of the joint velocity that a Panda measures at rest [rad/s]."""
_ALIVE_EVERY = 50
"""Control steps between two looks at whether the receiver of the units lives."""


@dataclass
class Ending:
    """End of a motion: written when it ends, and readable whatever is raised then."""

    stopped: str = ""
    """Reason of an early end, as a sentence; '' if it did not end early."""
    rest_unknown: str | None = None
    """Reason why the arm may not be at rest, as a sentence; '' if it is at rest, None if nobody has checked."""

    @property
    def early(self) -> bool:
        """True if it did not end as requested."""
        return bool(self.stopped or self.rest_unknown)

    def failed(self, arm: Arm, error: Exception) -> None:
        """Note an error after which the arm may still move, and check whether it is at rest."""
        self.stopped = self.stopped or error_text(error)
        self.rest_unknown = "" if _is_at_rest(arm) else error_text(error)

    def sentences(self) -> tuple[str, ...]:
        """Return the end as sentences."""
        rest = "The arm is at rest." if self.rest_unknown == "" else ""
        if self.rest_unknown:
            rest = f"The arm may not be at rest: {self.rest_unknown} Check it, and press the user stop."
        return tuple(filter(None, (rest, f"The run ended early: {self.stopped}" if self.stopped else "")))


class NoRecorder:
    """Keeps nothing."""

    def record(self, cycle: Cycle) -> None:
        """Take one turn of the loop."""


NO_RECORDER = NoRecorder()


def plan_to_start(model: RobotModel, q: FloatArray, path: ArmPath, floor: float) -> Plan | None:
    """Plan the slow way, straight in joint space, from q (n,) [rad] to where a path begins; None where it is there.

    Raises RobotError where there is none.
    """
    try:
        goal = brought_to(model, path.point(0.0))
        if np.abs(goal - q).max() < 1e-3:
            return None
        params = PlanParams(speed_share=_SHARE, speed_m_s=_SPEED_M_S, floor_m=floor)
        return approach(model, q, goal, params)
    except (CalibrationError, ExperimentError) as error:
        raise RobotError(f"No motion to the start of the path was found: {error}") from error


def announcement(controller: Controller, seconds: float, way: Plan | None, asks: str = "") -> tuple[str, ...]:
    """Say in sentences what the arm will do.

    Args:
        controller: that is going to move it.
        seconds: how long it will [s]; infinite until it is stopped.
        way: the way to the start of its path, if it goes there first.
        asks: what a commander lets it do in place of its path, if one does.
    """
    path, profile = controller.path, controller.profile
    points = np.array([path.point(phase) for phase in np.linspace(0.0, path.length, _PLACES)])
    low, high = points.min(axis=0), points.max(axis=0)
    room = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
    where = (
        f"The arm moves its end-effector at up to {profile.task.speed_m_s:g} m/s within {room} m (base frame); the arm"
        " as a whole needs more space."
    )
    if np.all(high - low < 1e-3):
        where = f"The arm keeps its end-effector at {vector(low, 2)} m (base frame)."
    first = (
        f"First the arm moves slowly, straight in joint space, to the start of its path ({way.duration:.0f} s). During"
        " this it does not avoid anybody, and stops if it is pushed."
        if way
        else ""
    )
    lasting = f"It runs for {seconds:g} s." if np.isfinite(seconds) else "It runs until it is stopped."
    stop = (
        "To stop it, press the user stop, which always works at once; Ctrl-C brings it to rest within its limits and"
        " ends the run."
    )
    return tuple(filter(None, (first, asks or where, profile.react.announced(controller.limits.period), lasting, stop)))


class RunFiles:
    """Files of a run: a recording, if requested, and the last seconds before HOLDs that latch; a context manager."""

    def __init__(
        self,
        standing: StandingArm,
        place: Path | None,
        folder: Path,
        tell: Callable[[str], None],
        learnt: FreeMotion | None = None,
        further: Recorder | None = None,
    ) -> None:
        """Open the files.

        Args:
            standing: the arm that is going to move.
            place: recording to write, if any.
            folder: for the last seconds before each HOLD that latches.
            tell: is called at once, without waiting, when the recording fails.
            learnt: what remembers free motion, if anything does.
            further: what else is given each cycle, if anything.
        """
        controller, about = standing.controller, {"robot": standing.arm.name}
        with ExitStack() as stack:
            self._recording = stack.enter_context(Recording(place, controller, about)) if place else None
            self._last_seconds = stack.enter_context(LastSeconds(controller, folder, self._recording, about=about))
            self._opened = stack.pop_all()
        self._tell, self._learnt = tell, learnt
        self._recorders: list[Recorder] = [one for one in (self._last_seconds, learnt, further) if one]
        self._notified = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._opened.close()

    def record(self, cycle: Cycle) -> None:
        """Keep one turn of the loop; that the recording fails is said once."""
        for recorder in self._recorders:
            recorder.record(cycle)
        if self.trouble and not self._notified:
            self._notified = True
            self._tell(self.trouble)

    @property
    def trouble(self) -> str:
        """Reason why the requested recording is incomplete, as a sentence, or ''."""
        return self._recording.trouble if self._recording else ""

    def close(self) -> tuple[str, ...]:
        """Finish the files; return a sentence on each."""
        sentences, last = list(self._learnt.save()) if self._learnt else [], self._last_seconds
        last.close()
        sentences += [f"The last seconds before a HOLD: {place}" for place in last.written]
        sentences += [last.trouble] if last.trouble else []
        return (*sentences, self._recording.close()) if self._recording else tuple(sentences)


def execute(
    standing: StandingArm,
    way: Plan | None,
    seconds: float,
    recorder: Recorder,
    clock: MonotonicClock,
    options: realtime.RealTimeOptions,
    ending: Ending,
) -> None:
    """Move an arm that was checked: to the start of its path, if it is not there, then under its controller.

    What ends it early is written to `ending`. An error before anything has moved is raised.
    """
    if way is not None:
        go(standing.arm, standing.controller, way, ending, left_out=standing.left_out)
        if not ending.early:
            try:
                q = np.array(standing.arm.read().q)
                ending.stopped = " ".join(refusals(check_start(standing.controller, q)))
            except PretouchError as error:
                ending.failed(standing.arm, error)
        if ending.early:
            ending.stopped = f"The arm did not reach the start of its path. {ending.stopped}"
            return
        options.tell("The arm is at the start of its path, and at rest.")
    try:
        follow(standing, clock, recorder, _Until(seconds, standing.skin), options, ending)
    except PretouchError as error:  # before the arm took the controller's commands
        if way is None:
            raise
        ending.failed(standing.arm, error)


class _Until:
    """Condition that ends a run."""

    def __init__(self, seconds: float, skin: SkinPort) -> None:
        self._seconds, self._units = seconds, skin if isinstance(skin, NetworkSkin) else None
        self._begin, self._steps = 0.0, 0

    def __call__(self, step: ControlStep) -> bool:
        """Return True if this step was the last; a receiver that has ended is a HardwareError."""
        self._begin = self._begin if self._steps else step.stamp
        self._steps += 1
        if self._units and self._steps % _ALIVE_EVERY == 0 and not self._units.alive:
            raise HardwareError("The receiver of the units has ended: see what it printed.")
        return step.stamp - self._begin >= self._seconds


def go(
    arm: Arm,
    controller: Controller,
    way: Plan,
    ending: Ending,
    recorder: Recorder = NO_RECORDER,
    left_out: Callable[[], float] = lambda: 0.0,
) -> None:
    """Move an arm along a plan, without a skin. A signal stops it, and is raised after it has come to rest.

    What the arm follows, and what ends it early, is `calibration.motion.follow`'s. `controller` gives arm and rate,
    `left_out` the time that this machine was too slow to simulate the arm so far [s].
    """
    ending.rest_unknown = None
    blind = plan_controller(controller.model, np.array(arm.read().q), controller.profile)
    realtime.warm_up(blind, arm.read())
    commander = PlanCommander(blind, way, time.monotonic, left_out)

    def move(signals: list[int]) -> str:
        def done(step: ControlStep) -> bool:
            return bool(signals) or commander.done(step)

        clock, options = MonotonicClock(blind.limits.period), loop.Options(desired=commander)
        with realtime.real_time():
            loop.run(blind, arm, NoUnits(), clock, recorder, done, options)
        return "A signal came." if signals else commander.stopped

    _run_motion(arm, move, ending)


def follow(
    standing: StandingArm,
    clock: MonotonicClock,
    recorder: Recorder,
    done: Callable[[ControlStep], bool],
    options: realtime.RealTimeOptions,
    ending: Ending,
) -> None:
    """Run the controller until `done`, a signal or a failure. The arguments are `realtime.run`'s.

    Everything is compiled before the arm takes commands. A signal is raised after the arm has come to rest.
    """
    arm, controller, ending.rest_unknown = standing.arm, standing.controller, None
    realtime.warm_up(controller, arm.read())

    def move(signals: list[int]) -> str:
        def over(step: ControlStep) -> bool:
            return bool(signals) or done(step)

        realtime.run(controller, arm, standing.skin, clock, recorder, over, options)
        return ""

    _run_motion(arm, move, ending)


def _run_motion(arm: Arm, move: Callable[[list[int]], str], ending: Ending) -> None:
    """Let an arm take commands from `move`, which receives the signals that came and returns why it stopped."""
    with noted_in_motion() as signals:
        try:
            arm.begin()
            ending.stopped = move(signals)
        except Exception as error:
            ending.stopped = error_text(error)
        finally:
            try:
                arm.end()
                ending.rest_unknown = ""
            except Exception as error:
                ending.failed(arm, error)


def _is_at_rest(arm: Arm) -> bool:
    """Return True if an arm whose motion could not be ended stands, as after a stop of its own."""
    begin = time.monotonic()
    while time.monotonic() < begin + _STAND_S:
        with suppress(Exception):  # whatever it is, the arm is not seen to stand
            state = arm.read()
            if state.stamp > begin and np.abs(state.qd).max() < _STILL_RAD_S:
                return True
        time.sleep(_LOOK_S)
    return False


def error_text(error: Exception) -> str:
    """Return the text of an error, with its type if it is not ours."""
    return str(error) if isinstance(error, PretouchError) else f"{type(error).__name__}: {error}"
