"""An arm follows a plan under its controller: the plan asks for positions, and what goes wrong ends the motion."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pretouch import desired
from pretouch.calibration.motion.plan import Plan
from pretouch.control.path import Path, segment
from pretouch.controller import Controller
from pretouch.desired import Desired
from pretouch.perception.scene_filter import no_fixtures
from pretouch.profiles import PROFILES, Profile, at_rate
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import ControlStep, FloatArray, Mode

START_RAD = 0.02
"""How far from the plan's start a joint may be for the plan to begin [rad]."""
_STRAY_RAD = 0.03
"""How far a joint may stray from the plan before the motion ends [rad]. It spends the plan's clearance: with all joints
as far off, each to the worse side, parts of a Panda come up to 20 mm nearer to each other than planned, of the 30 mm
that are kept by default. The simulated arm follows within 2 mrad."""
_AGES_S = (0.0, 0.025, 0.05)
"""How old the state of a step may be [s]: up to what the controller takes for fresh."""
_GAIN_1_S = 3.0
"""Velocity towards the plan per radian off it [1/s]: after a step that is late the arm is back within a second."""
_PATIENCE_S = 5.0
"""How long the controller may hold at once [s]: before the plan begins its force window fills for a second."""
_SETTLE_S = 1.0
"""Time after a hold in which the arm comes back to the plan, from where it had braked [s]."""
_AHEAD = 6
"""Positions that are asked for at once, a period apart, from one before now on: a step is stamped with its tick."""
_SHORTEST_M = 1e-5
"""A path must have a length: over so little an arm stands."""


def plan_controller(model: RobotModel, q: FloatArray, like: Profile | None = None) -> Controller:
    """Return the controller, without a skin, of an arm that stands at q (n,) [rad] and is to follow a plan.

    `like` is a profile whose rate and patience with failures count (None: `blind`).
    """
    profile = PROFILES["blind"]
    profile = replace(profile, task=replace(profile.task, position_gain_1_s=_GAIN_1_S))
    if like is not None:
        profile = replace(at_rate(profile, 1.0 / like.task.control_period_s), failure=like.failure)
    stands = standing_at(model.kinematics(q).position[model.ee])
    return Controller(model, Skin((), model), no_fixtures(), stands, profile)


def standing_at(point: FloatArray) -> Path:
    """Return the path of an arm that keeps its end-effector at a point (3,) [m], base frame."""
    x, y, z = point.tolist()
    return segment((x, y, z), (x, y, z + _SHORTEST_M))


class PlanCommander:
    """A commander for `loop.Options.desired` that has an arm stand until its controller tracks, and then follow a plan.

    While the controller holds for a reason that passes, as a late step, the plan waits. A contact, a HOLD that latches
    or lasts, and a joint that leaves the plan end it. `done` says of each step whether it was the last, and `stopped`
    then why the plan was not followed to its end. Time that a simulation of the arm leaves out is none of the plan's.
    """

    def __init__(
        self, controller: Controller, plan: Plan, now: Callable[[], float], left_out: Callable[[], float] = lambda: 0.0
    ) -> None:
        """Take the controller that turns, the plan, the clock of the steps [s], and the time left out so far [s]."""
        self._plan, self._now, self._left_out, self._names = plan, now, left_out, controller.model.joints
        self._ahead = controller.limits.period * np.arange(-1, _AHEAD - 1)
        self._last: float | None = None
        self._paused_s, self._settled = 0.0, -np.inf
        self.begin: float | None = None
        """Start of the plan, less time left out and holds [s]; None before it starts."""
        self.stopped = ""
        """Reason of an early end, as a sentence; '' if it did not end early."""

    def __call__(self) -> Desired:
        """Ask for the positions of the next moments; to stand before the plan begins."""
        if self.begin is None:
            return desired.joint_velocities(self._now(), np.zeros(len(self._names)))
        instants = self._now() + self._ahead
        since = instants - self._left_out() - self.begin
        return desired.joint_positions(instants, [self._plan.at(time)[0] for time in since])

    def done(self, step: ControlStep) -> bool:
        """Return True if the motion is over."""
        now = step.stamp - self._left_out()
        since, self._last = now - (now if self._last is None else self._last), now
        if step.mode is Mode.TRACK:
            self._paused_s = 0.0
            if self.begin is None:
                self.begin = now
                self.stopped = self._astray(step.q, 0.0, START_RAD, "The arm is not where the plan begins")
            elif now > self._settled:
                self.stopped = self._astray(step.q, now - self.begin, _STRAY_RAD, "The arm has left the plan")
        else:
            self._paused_s += since
            if self.begin is not None:
                self.begin, self._settled = self.begin + since, now + _SETTLE_S
            if step.mode is Mode.REACT or step.latched or self._paused_s > _PATIENCE_S:
                self.stopped = step.reason
        over = self.begin is not None and now >= self.begin + self._plan.duration
        return over or bool(self.stopped)

    def _astray(self, q: FloatArray, since: float, most: float, what: str) -> str:
        """Say which joint of q (n,) is farther from the plan at a time of it [s] than allowed [rad], or ''."""
        places = np.array([self._plan.at(since - age)[0] for age in _AGES_S])
        off = np.maximum(places.min(axis=0) - q, q - places.max(axis=0))
        joint = int(np.argmax(off))
        if off[joint] <= most:
            return ""
        return f"{what}: {self._names[joint]} is {off[joint]:.3f} rad off (limit {most:g} rad); check what holds it."
