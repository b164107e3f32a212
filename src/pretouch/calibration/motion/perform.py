"""Moving an arm along a plan, and stopping it when anything is not as planned."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.calibration.motion.plan import Plan
from pretouch.checks import Checked, Fraction, NonNegative, Positive
from pretouch.control.joint_box import box_and_brake, joint_limits
from pretouch.errors import CalibrationError
from pretouch.faults import sound_robot
from pretouch.loop import come_to_rest, undisturbed
from pretouch.ports import Clock, Robot
from pretouch.robot.model import RobotModel
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
    path_tolerance_rad: Positive = 0.1
    """How far from the plan a joint may stray before the arm is stopped [rad]."""
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

    Args:
        robot: to command, at rest at the plan's start.
        clock: ticks every `params.period_s`.
        model: of the robot.
        plan: where to go. `approach` gives the way to its start.
        params: see there.
        on_tick: called after each command with the instant of the tick [s]: to collect what the units send. An
            exception in it stops the arm too.

    Raises CalibrationError, before anything is commanded, where the arm is not at rest at the plan's start.
    """
    _check_start(robot.read(), model, plan, params)
    follower = _Follower(robot, clock, model, plan, params)
    try:
        stopped = follower.follow(on_tick)
    except Exception as error:  # whatever it is, the arm comes to rest, and what was measured is kept
        stopped = f"{type(error).__name__}: {error}"
    finally:
        follower.come_to_rest()
    return Performance(follower.joints(), follower.begin, stopped)


def _check_start(state: RobotState, model: RobotModel, plan: Plan, params: PerformParams) -> None:
    """Refuse an arm that is not at rest at the plan's start."""
    sound, wrong = sound_robot(state, model.description.qd_max)
    if sound is None:
        raise CalibrationError(f"The robot's state cannot be used: {wrong}; check the connection.")
    off = np.abs(sound.q - plan.start)
    joint = int(np.argmax(off))
    if off[joint] > params.start_tolerance_rad:
        raise CalibrationError(
            f"The arm is not where the plan begins: {model.joints[joint]} is {off[joint]:.3f} rad off, at most"
            f" {params.start_tolerance_rad:g} rad is allowed; move the arm there first."
        )
    if np.any(sound.qd_commanded):
        raise CalibrationError("The arm is moving: let it come to rest before a plan begins.")


class _Follower:
    """One run along a plan."""

    def __init__(self, robot: Robot, clock: Clock, model: RobotModel, plan: Plan, params: PerformParams) -> None:
        self._robot, self._clock, self._model, self._plan, self._params = robot, clock, model, plan, params
        self._limits = joint_limits(model, params.margin_rad, params.period_s)
        self._touch = params.touch_share * model.description.tau_max
        self._q, self._sent = plan.start, np.zeros(model.n)
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
        while tick - self.begin < self._plan.duration:
            state, wrong = sound_robot(self._robot.read(), self._limits.qd_max)
            if state is None:
                return f"The robot's state cannot be used: {wrong}."
            trouble = self._trouble(state, tick)
            if trouble:
                return trouble
            self._keep(state)
            self._go_on(state, tick - self.begin)
            on_tick(tick)
            tick = self._clock.tick()
        return None

    def _trouble(self, state: RobotState, tick: float) -> str | None:
        """Say what is not as planned, or None."""
        p, names = self._params, self._model.joints
        if abs(tick - state.stamp) > p.state_timeout_s:
            return f"The robot's newest state is {tick - state.stamp:.3f} s old: check the connection."
        off = np.abs(state.q - self._plan.at(state.stamp - self.begin)[0])
        if off.max() > p.path_tolerance_rad:
            joint = int(np.argmax(off))
            return f"{names[joint]} strayed {off[joint]:.3f} rad from the plan: see what held it."
        pushed = np.abs(np.asarray(state.tau_ext, dtype=np.float64)) / self._touch
        if not np.all(pushed <= 1.0):
            joint = int(np.argmax(pushed))
            return f"{names[joint]} was pushed with {state.tau_ext[joint]:.1f} Nm: see who or what touches the arm."
        return None

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

    def come_to_rest(self) -> None:
        """Brake within the limits, whoever interrupts."""
        with undisturbed():
            come_to_rest(self._limits, self._robot, self._clock, self._q, self._sent)

    def _send(self, q: FloatArray, qd: FloatArray) -> None:
        """Command joint velocities, the arm's motion generator being at q."""
        self._q, self._sent = q, qd
        self._robot.command(qd)
