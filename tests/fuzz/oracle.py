"""What a step should say, reckoned from its inputs alone: the cause that counts, its words, and how fast at most."""

from dataclasses import dataclass

import numpy as np

from pretouch.contact.admittance import Admittance
from pretouch.contact.decaying_velocity import DecayingVelocity
from pretouch.profiles import Profile
from pretouch.types import ControlStep, Inputs, Mode, QpOutcome, RobotState

SHOWN, NEAR, NO_TARGET = {0, 6, 11}, {3, 13}, {1, 2, 4, 7}

WORDS = {
    "unusable": "The robot's state cannot be used", "backwards": "Time went backwards (from",
    "stale": "The robot's state is",
    "failed": "gave no answer", "blocked": "The approach limits cannot be met",
    "blocked reaction": "allow no motion within", "contact": "A contact of", "reacting": "Moving with a contact",
    "silent": "No usable reading from", "no force": "no force estimate", "overrun": "The step before this one was",
    "filling": "The force window is filling", "clear": "Moving as asked.", "opening": "Clamped between two objects",
    "caught": "The arm was clamped between two objects", "yielding": "Yielding to a contact",
    "given up": "Given up after", "pressed": "A force that does not move the arm",
}  # fmt: skip
"""Cause -> words its sentence holds."""

MODES = {
    "contact": Mode.REACT,
    "reacting": Mode.REACT,
    "blocked reaction": Mode.REACT,
    "clear": Mode.TRACK,
    "opening": Mode.REACT,
    "yielding": Mode.REACT,
}
"""Cause -> mode; what is not here is a HOLD."""

LARGEST = 1e3
"""Joint position or velocity from which on a robot's state is not believed [rad, rad/s]."""

STRONGEST = 1e4
"""External joint torque from which on it is none [Nm]."""

LATEST = 1e12
"""Time stamp from which on it is none [s]."""

LATCHING = {"unusable", "backwards", "stale", "failed", "latched", "caught"}


@dataclass
class Expected:
    """What is to be believed of one step's inputs, and what follows."""

    believed: bool
    fault: str
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
        self.decay_cycles = DecayingVelocity.of(profile.react, profile.task.control_period_s).decay_cycles
        self.reacted = self.decay_cycles

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
            not fault, fault, self.q, self.qd, now, w[:3].copy() if felt else None, strained,
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

    def _fault(self, inputs: Inputs) -> str:
        r = inputs.robot
        numbers = np.concatenate((r.q, r.qd, r.q_commanded, r.qd_commanded))
        if not (np.abs(numbers) < LARGEST).all():  # what is no number is not below
            return "unusable"
        if (
            not (abs(inputs.stamp) < LATEST and abs(r.stamp) < LATEST)
            or (np.abs(r.qd_commanded) >= 2 * self.qd_max).any()
        ):
            return "unusable"
        if inputs.stamp < self.stamp:
            return "backwards"
        return "stale" if abs(inputs.stamp - r.stamp) > self.p.failure.state_timeout_s else ""

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

    def cause(self, e: Expected, step: ControlStep, resume: bool) -> str:
        """Name the cause that should have decided the step's mode, and remember it."""
        cause = self._cause(e, step, resume)
        if MODES.get(cause) is Mode.REACT:
            self.reacted = 1 if cause == "contact" or self.mode is not Mode.REACT else self.reacted + 1
        else:
            self.reacted = self.decay_cycles
        self.samples = min(self.samples + (e.force is not None), self.p.window.samples)
        self.mode, self.latched, self.reason = step.mode, cause in LATCHING, step.reason
        self.q, self.qd = self.q + step.command * self.p.task.control_period_s, step.command.copy()
        return cause

    def _cause(self, e: Expected, step: ControlStep, resume: bool) -> str:
        first = e.fault or self._first(e, step, resume)
        moves = MODES.get(first)
        if moves is None or step.qp.outcome is QpOutcome.SOLVED:
            return first
        if step.qp.outcome is QpOutcome.FAILED:
            return "failed"
        return "blocked" if moves is Mode.TRACK else "blocked reaction"

    def _first(self, e: Expected, step: ControlStep, resume: bool) -> str:
        """What decides the mode of a step whose inputs can be believed, before the quadratic program."""
        if self.latched and not resume:
            return "latched"
        decays = isinstance(self.p.react, DecayingVelocity)
        if decays and self.mode is Mode.REACT and self.reacted < self.decay_cycles:
            return "reacting"
        if self.mode is not Mode.REACT and self.feels_contact(e, step):
            return "contact"
        if self.p.detect.by_torques or not decays:
            return self._told(e, step)
        filling = self.samples < self.p.window.samples
        seen = {"silent": bool(e.silent), "no force": e.no_force, "overrun": e.overrun, "filling": filling}
        return next((cause for cause, here in seen.items() if here), "clear")

    def _told(self, e: Expected, step: ControlStep) -> str:
        """Take the step's word for what has a memory of its own, where nothing it was given speaks against it."""
        told = next(cause for cause, words in WORDS.items() if words in step.reason)
        waiting = told in ("yielding", "opening", "caught")
        assert not waiting or self.mode is Mode.REACT
        if waiting or told in ("blocked", "blocked reaction", "failed"):
            return told if waiting else "yielding" if told == "blocked reaction" else "clear"
        seen = {
            "silent": bool(e.silent),
            "no force": e.no_force or (self.p.detect.by_torques and not e.strained),
            "overrun": e.overrun,
        }
        first = next((cause for cause, here in seen.items() if here), "")
        free = ("given up", "pressed", "filling", "clear")
        assert first or told in free, (told, step.reason)
        if not first and told == "clear":
            assert self.samples >= self.p.window.samples
        return first or told

    def feels_contact(self, e: Expected, step: ControlStep) -> bool:
        """Whether the force crosses the thresholds the step gives."""
        r = self.p.react
        sticks = self.mode is Mode.HOLD and isinstance(r, Admittance) and r.soft_hold and r.static_friction_nm > 0
        if self.p.detect.by_torques or sticks:
            return step.contact is not None
        if e.force is None or self.samples < self.p.window.samples:
            return False
        compared = step.filtered_force if self.p.detect.compare == "filtered" else e.force
        return bool(np.any((compared > step.thresholds.upper) | (compared < step.thresholds.lower)))
