"""Moving an arm along a plan, and stopping it when anything is not as planned."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from signal import SIGINT, SIGTERM

import numpy as np

from pretouch.calibration.motion.plan import Plan
from pretouch.checks import Checked, Fraction, NonNegative, Positive
from pretouch.control.joint_box import box_and_brake, joint_limits
from pretouch.errors import CalibrationError
from pretouch.faults import sound_robot
from pretouch.loop import come_to_rest
from pretouch.ports import Clock, Robot
from pretouch.robot.model import RobotModel
from pretouch.signals import noted
from pretouch.traces import JointTrace
from pretouch.types import FloatArray, RobotState


@dataclass(frozen=True)
class PerformParams(Checked):
    """How closely an arm is made to follow a plan, and what stops it. Figures without a source are ours."""

    period_s: Positive = 0.01
    """Period of the clock [s]."""
    gain_1_s: NonNegative = 2.0
    """Velocity towards the plan per radian off it [1/s]."""
    margin_rad: NonNegative = 0.01
    """Distance that commands keep from the joint limits [rad]."""
    start_tolerance_rad: Positive = 0.02
    """How far from the plan's start a joint may be for the plan to begin [rad]."""
    start_speed_rad_s: Positive = 0.05
    """Speed up to which a joint counts as at rest: six standard deviations of what a Panda measures at rest [rad/s]."""
    path_tolerance_rad: Positive = 0.03
    """How far a joint may stray from the plan, and from where it is commanded to be, before the arm is stopped [rad].

    It spends the plan's clearance, which holds on the plan alone: with all joints as far off as this, each to the worse
    side, parts of a Panda come up to 20 mm nearer to each other than planned, of the 30 mm kept by default.
    Choose it in proportion to `PlanParams.clearance_m`. The simulated arm follows within 4 mrad. An arm that goes on
    at its last velocity while its program pauses is off by half the plan's acceleration times that time squared: up to
    13 mrad after 50 ms, and after 0.1 s it is stopped."""
    state_timeout_s: Positive = 0.1
    """Age of the robot's newest state at which the arm is stopped [s]."""
    touch_share: Fraction = 0.15
    """Share of its largest torque that a joint may be pushed with before the arm is stopped: 13 Nm for the large joints
    of a Panda, 1.8 Nm for the small ones."""


@dataclass(frozen=True, eq=False)
class Performance:
    """What became of a plan."""

    joints: JointTrace
    """Joint positions measured, as far as it went."""
    begin: float
    """Instant at which the plan began [s]."""
    stopped: str | None
    """Why it was ended early, as a sentence; None: it was not."""


def perform(
    robot: Robot,
    clock: Clock,
    model: RobotModel,
    plan: Plan,
    params: PerformParams = PerformParams(),
    on_tick: Callable[[float], None] = lambda tick: None,
) -> Performance:
    """Move an arm along a plan. However it ends, the arm is brought to rest within its limits.

    What the robot says of its joints and of the torques on them counts; its estimate of the force on the TCP is not
    used. Commands and ticks that fail on the way to rest are named in `stopped`, and what was measured is kept.

    Args:
        robot: to command, at rest at the plan's start.
        clock: ticks every `params.period_s`.
        model: of the robot.
        plan: where to go. `approach` gives the motion to its start.
        params: see there.
        on_tick: called after each command with the instant of the tick [s]: to collect what the units send. An
            exception in it stops the arm too.

    Raises CalibrationError, before anything is commanded, where the arm is not at rest at the plan's start.
    """
    tick = clock.tick()
    follower = _Follower(robot, clock, model, plan, params, _checked_start(robot.read(), tick, model, plan, params))
    try:
        stopped = follower.follow(on_tick)
    except Exception as error:  # whatever it is, the arm comes to rest, and what was measured is kept
        stopped = _named(error)
    except BaseException as interrupt:
        failed = follower.come_to_rest()
        if failed:
            interrupt.add_note(failed)
        raise
    failed = follower.come_to_rest()
    if failed:
        stopped = f"{stopped.rstrip('. ')}. {failed}" if stopped else failed
    return Performance(follower.joints(), follower.begin, stopped)


def _named(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def _checked_start(state: RobotState, tick: float, model: RobotModel, plan: Plan, params: PerformParams) -> RobotState:
    """Return the state of an arm that is at rest at the plan's start; any other is a CalibrationError."""
    sound, wrong = sound_robot(state, model.description.qd_max)
    if sound is None:
        raise CalibrationError(f"The robot's state cannot be used ({wrong}): check the connection.")
    trouble = (
        _old(sound, tick, params)
        or _misshapen(state, model.n)
        or _elsewhere(sound, model, plan, params.start_tolerance_rad)
        or _moving(sound, model, params)
        or _dragged(sound, model, params.start_tolerance_rad)
    )
    if trouble:
        raise CalibrationError(trouble)
    return sound


def _elsewhere(state: RobotState, model: RobotModel, plan: Plan, tolerance: float) -> str | None:
    """Say which joint is not at the plan's start, within a tolerance [rad], or None."""
    off = np.abs(state.q - plan.start)
    joint = int(np.argmax(off))
    if off[joint] <= tolerance:
        return None
    return (
        f"The arm is not where the plan begins: {model.joints[joint]} is {off[joint]:.3f} rad off (limit {tolerance:g}"
        " rad): move the arm there first."
    )


def _moving(state: RobotState, model: RobotModel, params: PerformParams) -> str | None:
    """Say which joint moves, or None."""
    speed = np.maximum(np.abs(state.qd), np.abs(state.qd_commanded))
    joint = int(np.argmax(speed))
    if speed[joint] <= params.start_speed_rad_s:
        return None
    name = model.joints[joint]
    return f"The arm is moving, {name} at {speed[joint]:.3f} rad/s: let it come to rest before a plan begins."


def _old(state: RobotState, tick: float, params: PerformParams) -> str | None:
    """Say how old a state is that is none of now, at a tick [s], or None."""
    age = tick - state.stamp
    if abs(age) <= params.state_timeout_s:
        return None
    when = f"{-age:.3f} s in the future" if age < 0 else f"{age:.3f} s old"
    return f"The robot's newest state is {when}: check the connection."


def _misshapen(state: RobotState, joints: int) -> str | None:
    """Say what the external torques are, as the robot gave them, if they are no number a joint, or None."""
    try:
        shape = np.asarray(state.tau_ext, dtype=np.float64).shape
    except (TypeError, ValueError):
        return "The robot's external torques are not an array of numbers: check its driver."
    if shape == (joints,):
        return None
    return f"The robot's external torques have the shape {shape}, not ({joints},): check its driver."


def _dragged(state: RobotState, model: RobotModel, tolerance: float) -> str | None:
    """Say which joint is not where it is commanded to be, within a tolerance [rad], or None."""
    off = np.abs(state.q_commanded - state.q)
    joint = int(np.argmax(off))
    if off[joint] <= tolerance:
        return None
    return f"{model.joints[joint]} is {off[joint]:.3f} rad from its commanded position: check what holds it."


class _Follower:
    """One run along a plan."""

    def __init__(
        self, robot: Robot, clock: Clock, model: RobotModel, plan: Plan, params: PerformParams, state: RobotState
    ) -> None:
        self._robot, self._clock, self._model, self._plan, self._params = robot, clock, model, plan, params
        self._limits = joint_limits(model, params.margin_rad, params.period_s)
        self._touch = params.touch_share * model.description.tau_max
        self._q, self._sent = state.q_commanded, state.qd_commanded
        self._stamps: list[float] = []
        self._measured: list[FloatArray] = []
        self.begin = 0.0
        """Instant at which the plan began [s]."""

    def joints(self) -> JointTrace:
        """Return what was measured."""
        return JointTrace(np.array(self._stamps), np.array(self._measured).reshape(-1, self._model.n))

    def follow(self, on_tick: Callable[[float], None]) -> str | None:
        """Go along the plan; return why that ended early, or None."""
        tick = self.begin = self._clock.tick()
        while math.isfinite(tick):
            if tick - self.begin >= self._plan.duration:
                return None
            given = self._robot.read()
            state, wrong = sound_robot(given, self._limits.qd_max)
            if state is None:
                return f"The robot's state cannot be used: {wrong}."
            trouble = _old(state, tick, self._params) or _misshapen(given, self._model.n) or self._trouble(state)
            if trouble:
                return trouble
            self._keep(state)
            self._go_on(state, tick - self.begin)
            on_tick(tick)
            tick = self._clock.tick()
        return f"The clock ticked at {tick} s: check the clock."

    def _trouble(self, state: RobotState) -> str | None:
        """Say what is not as planned, or None."""
        p, names = self._params, self._model.joints
        off = np.abs(state.q - self._plan.at(state.stamp - self.begin)[0])
        if off.max() > p.path_tolerance_rad:
            joint = int(np.argmax(off))
            return f"{names[joint]} strayed {off[joint]:.3f} rad from the plan: check what held it."
        torque = np.asarray(state.tau_ext, dtype=np.float64)
        pushed = np.abs(torque) / self._touch
        if not np.all(pushed <= 1.0):
            joint = int(np.argmax(pushed))
            return f"{names[joint]} was pushed with {torque[joint]:.1f} Nm: check who or what touches the arm."
        return _dragged(state, self._model, p.path_tolerance_rad)

    def _keep(self, state: RobotState) -> None:
        if not self._stamps or state.stamp > self._stamps[-1]:
            self._stamps.append(state.stamp)
            self._measured.append(state.q)

    def _go_on(self, state: RobotState, since: float) -> None:
        """Command what brings the arm to where it is to be a period later."""
        period = self._params.period_s
        here, there = self._plan.at(since)[0], self._plan.at(since + period)[0]
        wanted = (there - here) / period + self._params.gain_1_s * (here - state.q)
        lower, upper, _ = box_and_brake(state.q_commanded, self._sent, self._limits.table)
        self._send(state.q_commanded, np.clip(wanted, lower, upper))

    def come_to_rest(self) -> str | None:
        """Brake within the limits, whoever interrupts; return what failed, as a sentence, or None."""
        try:
            with noted(SIGINT, SIGTERM):  # until the arm is at rest
                come_to_rest(self._limits, self._robot, self._clock, self._q, self._sent)
        except Exception as error:
            return f"The arm could not be brought to rest without an error: {_named(error)}"
        return None

    def _send(self, q: FloatArray, qd: FloatArray) -> None:
        """Command joint velocities, the arm's motion generator being at q."""
        self._q, self._sent = q, qd
        self._robot.command(qd)
