"""A contact detector of your own in a profile: a cumulative sum of the force beyond its usual spread.

    python examples/05_your_own_detector.py

An entry point of the group `pretouch.detectors` makes the class available in every command, by `--profile
paper:detect=cusum`.
"""

from dataclasses import dataclass, replace

import numpy as np

import pretouch as pt


@dataclass(frozen=True)
class Cusum(pt.Detector, name="cusum"):
    """Page's test on the norm of the force: it sums the deviations from the window's mean beyond `drift_n`."""

    by_torques = False  # the force is enough
    drift_n: float = 3.0
    """Largest usual deviation in free motion [N]."""
    limit_n: float = 20.0
    """Least sum of a contact [N]."""

    def init(self, body, learnt=None):
        return 0.0

    def step(self, state, body, sample):
        mean, none = sample.window.mean(), np.full(len(sample.robot.q), np.nan)
        force = np.zeros(3) if sample.robot.wrench is None else sample.robot.wrench[:3] - mean
        total = max(0.0, state + float(np.linalg.norm(force)) - self.drift_n) if sample.armed else 0.0
        band, still = np.full(3, self.limit_n), np.zeros(3)
        limits = pt.Thresholds(mean + band, mean - band, mean, sample.window.std(), still, still)
        contact = pt.Contact(force, np.abs(force) == np.abs(force).max()) if total >= self.limit_n else None
        return pt.Detection(limits, contact, sample.armed, none, total / self.limit_n), total


arm = pt.RobotModel(pt.panda())
profile = replace(pt.profile("blind"), name="blind with a cumulative sum", detect=Cusum())
control = pt.Controller(arm, pt.Skin((), arm), pt.no_fixtures(), pt.segment((0.3, 0.0, 0.5), (0.3, 0.2, 0.5)), profile)
rng, q, rest, state, reason = np.random.default_rng(0), arm.description.q_ready, np.zeros(7), None, ""
for i in range(300):
    push = np.array([0.0, -8.0, 0.0]) if i >= 200 else np.zeros(3)
    wrench = np.concatenate([rng.normal(0.0, 0.5, 3) + push, np.zeros(3)])
    robot = pt.RobotState(0.01 * i, q, rest, q, rest, rest, wrench)
    state = control.init(robot) if state is None else state
    none = pt.RangeReadings(np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
    step, state = control.step(state, pt.Inputs(0.01 * i, robot, none))
    if step.reason.split("(")[0] != reason:
        reason = step.reason.split("(")[0]
        print(f"{step.stamp:5.2f} s  {step.mode.value:5}  {step.reason}")
