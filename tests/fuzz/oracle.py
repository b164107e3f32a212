"""What is to be believed of a step's inputs, reckoned from them alone, and how fast the arm may go at most."""

from dataclasses import dataclass

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.modes import Event
from pretouch.profiles import Profile
from pretouch.types import ControlStep, Inputs, Mode, RobotState

SHOWN, NEAR, NO_TARGET = {0, 6, 11}, {3, 13}, {1, 2, 4, 7}

LARGEST = 1e3
"""Joint position or velocity from which on a robot's state is not believed [rad, rad/s]."""

STRONGEST = 1e4
"""External joint torque from which on it is none [Nm]."""

LATEST = 1e12
"""Time stamp from which on it is none [s]."""


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
        self.p, self.ids, self.qd_max = profile, ids, qd_max
        self.sent: list[tuple[float, np.ndarray]] = []
        self.stamp = self.force_stamp = robot.stamp
        self.used = np.full(len(ids), -np.inf)
        self.heard = np.full(len(ids), -np.inf)
        self.q, self.qd = robot.q_commanded.copy(), robot.qd_commanded.copy()
        self.mode, self.latched, self.reason = Mode.HOLD, False, ""
        self.samples = 0

    def expect(self, inputs: Inputs) -> Expected:
        """Judge the inputs of the next step."""
        p, robot = self.p, inputs.robot
        fault = self._fault(inputs)
        last = self.stamp
        now = self.stamp = inputs.stamp if abs(inputs.stamp) < LATEST else self.stamp
        kept = int(p.failure.state_timeout_s / p.task.control_period_s) + 1
        self.sent = [] if now < last else [*self.sent[-kept:], (last, self.qd)]
        if not fault:
            self._believe(robot, last, now)
        w = None if fault else robot.wrench
        tau = np.array(np.nan if fault or robot.tau_ext is None else robot.tau_ext, dtype=np.float64)
        strained = tau.shape == self.qd_max.shape and bool((np.abs(tau) < STRONGEST).all())
        felt = w is not None and bool(np.isfinite(w).all() and np.abs(w).max() < p.failure.force_max_n)
        self.force_stamp = now if (felt if not p.detect.by_torques else strained) else min(self.force_stamp, now)
        self._hear(inputs, now, now < last)
        age = now - self.heard if p.perception is not None and len(self.ids) else np.zeros(0)
        slow, stop = p.sight.slow_after_s, p.sight.silent_after_s
        return Expected(
            fault, self.q, self.qd, now, w[:3].copy() if felt else None, strained,
            overrun=not fault and now - last > p.failure.overrun_s,
            no_force=not fault and now - self.force_stamp > p.failure.force_timeout_s,
            silent=[name for name, a in zip(self.ids, age, strict=False) if a >= stop],
            scale=min(max(float(stop - age.max(initial=0.0)) / (stop - slow), 0.0), 1.0),
        )  # fmt: skip

    def _believe(self, robot: RobotState, last: float, now: float) -> None:
        """Go by a report, and by the commands it cannot know of."""
        if robot.stamp > last or now == last:
            self.q, self.qd = robot.q_commanded.copy(), robot.qd_commanded.copy()
            return
        q, at = robot.q_commanded.copy(), robot.stamp
        for (_, command), end in zip(self.sent, [*(t for t, _ in self.sent[1:]), now], strict=True):
            if end > at:
                q, at = q + command * (end - at), end
        self.q = q

    def _fault(self, inputs: Inputs) -> Event | None:
        r = inputs.robot
        numbers = np.concatenate((r.q, r.qd, r.q_commanded, r.qd_commanded))
        if not (np.abs(numbers) < LARGEST).all():  # what is no number is not below
            return Event.UNUSABLE
        if (
            not (abs(inputs.stamp) < LATEST and abs(r.stamp) < LATEST)
            or (np.abs(r.qd_commanded) >= 2 * self.qd_max).any()
        ):
            return Event.UNUSABLE
        if inputs.stamp < self.stamp:
            return Event.TIME_BACKWARDS
        return Event.STATE_STALE if abs(inputs.stamp - r.stamp) > self.p.failure.state_timeout_s else None

    def _hear(self, inputs: Inputs, now: float, forget: bool) -> None:
        if self.p.perception is None:
            return
        if forget:
            self.used[:], self.heard[:] = -np.inf, -np.inf
        readings = inputs.readings
        rows = zip(readings.stamp.tolist(), readings.distance.tolist(), readings.status.tolist(), strict=True)
        for k, (stamp, distance, status) in enumerate(rows):
            if self.used[k] < stamp <= now:
                self.used[k] = stamp
                if status in NEAR or status in NO_TARGET or (status in SHOWN and 0 <= distance < np.inf):
                    self.heard[k] = stamp

    def remember(self, e: Expected, step: ControlStep) -> None:
        """Go on from what a step decided."""
        self.samples = min(self.samples + (e.force is not None), self.p.window.samples)
        self.mode, self.latched, self.reason = step.mode, step.latched, step.reason
        self.q, self.qd = self.q + step.command * self.p.task.control_period_s, step.command.copy()

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
