"""What is to be believed of a step's inputs, by the plain controller of `tests.reference`, and how fast at most."""

from dataclasses import dataclass

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.modes import Event
from pretouch.profiles import Profile
from pretouch.types import ControlStep, Inputs, Mode, RobotState
from tests.reference.modes import FAULTS, Trust
from tests.reference.perception import tells

STRONGEST = 1e4
"""External joint torque from which on it is none [Nm]."""


@dataclass
class Expected:
    """What is to be believed of one step's inputs, and what follows."""

    fault: Event | None
    """Why the robot's state is not believed."""
    q: np.ndarray
    """(n,) commanded joint positions to go by [rad]."""
    qd: np.ndarray
    """(n,) commanded joint velocities to go by [rad/s]."""
    now: float
    force: np.ndarray | None
    strained: bool
    """Whether joint torques can be believed."""
    overrun: bool
    no_force: bool
    silent: list[str]
    scale: float
    """Largest factor on the speed that silent units allow."""


class Oracle:
    """Remembers what has to be remembered, apart from the controller's own state."""

    def __init__(self, profile: Profile, ids: tuple[str, ...], robot: RobotState, qd_max: np.ndarray) -> None:
        self.p, self.ids = profile, ids
        self.trust, self.command = Trust(robot, profile.failure, qd_max), robot.qd_commanded
        self.strained = robot.stamp
        self.used = np.full(len(ids), -np.inf)
        self.heard = np.full(len(ids), -np.inf)
        self.mode, self.latched, self.reason = Mode.HOLD, False, ""
        self.samples = 0

    def expect(self, inputs: Inputs) -> Expected:
        """Judge the inputs of the next step."""
        p, last = self.p, self.trust.now
        robot, wrong = self.trust.judge(inputs, self.command, p.task.control_period_s)
        now = self.trust.now
        fault = next((event for event in FAULTS if event in wrong), None)
        tau = np.array(np.nan if fault or inputs.robot.tau_ext is None else inputs.robot.tau_ext, dtype=np.float64)
        strained = tau.shape == self.command.shape and bool((np.abs(tau) < STRONGEST).all())
        self.strained = now if strained else min(self.strained, now)
        no_force = now - self.strained > p.failure.force_timeout_s if p.detect.by_torques else Event.NO_FORCE in wrong
        if p.perception is not None:
            self._hear(inputs, now, now < last)
        age = now - self.heard if p.perception is not None and len(self.ids) else np.zeros(0)
        slow, stop = p.sight.slow_after_s, p.sight.silent_after_s
        return Expected(
            fault, robot.q_commanded, robot.qd_commanded, now, None if robot.wrench is None else robot.wrench[:3],
            strained, overrun=Event.OVERRUN in wrong, no_force=not fault and no_force,
            silent=[name for name, a in zip(self.ids, age, strict=False) if a >= stop],
            scale=min(max(float(stop - age.max(initial=0.0)) / (stop - slow), 0.0), 1.0),
        )  # fmt: skip

    def _hear(self, inputs: Inputs, now: float, forget: bool) -> None:
        if forget:
            self.used[:], self.heard[:] = -np.inf, -np.inf
        readings = inputs.readings
        rows = zip(readings.stamp.tolist(), readings.distance.tolist(), readings.status.tolist(), strict=True)
        for k, (stamp, distance, status) in enumerate(rows):
            if self.used[k] < stamp <= now:
                self.used[k] = stamp
                self.heard[k] = stamp if tells(distance, status) else self.heard[k]

    def remember(self, e: Expected, step: ControlStep) -> None:
        """Go on from what a step decided."""
        self.samples = min(self.samples + (e.force is not None), self.p.window.samples)
        self.mode, self.latched, self.reason = step.mode, step.latched, step.reason
        self.command = step.command.copy()

    def speaks_against(self, e: Expected) -> dict[Event, bool]:
        """What forbids to follow the path, and whether it is so."""
        no_torques = self.p.detect.by_torques and not e.strained
        return {
            Event.SKIN_SILENT: bool(e.silent), Event.NO_FORCE: e.no_force or no_torques, Event.OVERRUN: e.overrun,
        }  # fmt: skip

    def feels_contact(self, e: Expected, step: ControlStep) -> bool:
        """Whether a contact is due: the force crosses the thresholds the step gives, where nothing is under way."""
        if self.mode is Mode.REACT:
            return False
        r = self.p.react
        sticks = self.mode is Mode.HOLD and isinstance(r, Admittance) and r.soft_hold and r.static_friction_nm > 0
        if self.p.detect.by_torques or sticks:
            return step.contact is not None
        if e.force is None or self.samples < self.p.window.samples:
            return False
        compared = step.filtered_force if self.p.detect.compare == "filtered" else e.force
        return bool(np.any((compared > step.thresholds.upper) | (compared < step.thresholds.lower)))
