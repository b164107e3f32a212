"""What a fuzzed controller is told: readings, forces, stamps and robot states, wrong in any way that may come."""

from dataclasses import dataclass, replace

import numpy as np

from pretouch.types import Inputs, RangeReadings, RangeStatus

STATUS = [*map(int, RangeStatus), 42, -1, 1 << 40]
SIGHTS = [
    "clear", "clear", "clear", "far", "near", "around", "inside", "chaos", "nan", "below zero", "huge", "stale", "old",
    "future", "backwards", "no stamps", "failing",
]  # fmt: skip
FORCES = ["calm", "calm", "calm", "push", "steps", "huge", "beyond", "nan", "inf", "denormal", "none", "torque"]
FAULTS = [
    "q", "qd", "q_commanded", "qd_commanded", "robot stamp", "step stamp", "stale", "future", "backwards",
    "jump", "overrun",
]  # fmt: skip
LIES = [3.0, -3.0, 30.0, 999.0, -999.0, 1e3, -1e9, 1e300, 1e306, -1e308]
NOT_FINITE = [np.nan, np.inf, -np.inf]


@dataclass
class Weather:
    """What lasts for some steps: what the units see, and what force is felt."""

    rng: np.random.Generator
    units: int
    sight: str = "clear"
    feel: str = "calm"
    left: int = 20

    def __post_init__(self) -> None:
        self._change()

    def _change(self) -> None:
        self.sight = str(self.rng.choice(SIGHTS))
        self.feel = str(self.rng.choice(FORCES)) if self.rng.random() < 0.5 else "calm"
        self.left = int(self.rng.geometric(1 / 12))
        self.distance = self.rng.uniform(0.0, 1.0, self.units)
        self.status = self.rng.choice(STATUS, self.units)
        self.push = self.rng.normal(scale=60.0, size=3)
        self.strain = self.rng.normal(scale=20.0, size=7) * (self.rng.random(7) < 0.6)
        self.began = np.nan

    def pass_on(self) -> None:
        """Let one step pass."""
        self.left -= 1
        if self.left <= 0:
            self._change()

    def readings(self, now: float) -> RangeReadings:
        """Return what the units say."""
        if np.isnan(self.began):
            self.began = now
        rng, k = self.rng, self.units
        stamp, distance, status = np.full(k, now), self.distance.copy(), np.zeros(k, np.int64)
        s = self.sight
        if s == "clear":
            status[:] = RangeStatus.SIGNAL
        elif s == "far":
            distance += 0.8
        elif s == "near":
            distance *= 0.4
        elif s == "around":
            distance[:] = 0.04
        elif s == "inside":
            distance[:] = rng.choice([0.045, 0.065, 0.08, 0.1, 0.0])
        elif s == "chaos":
            distance, status = rng.uniform(-0.5, 4.5, k), rng.choice(STATUS, k)
        elif s == "nan":
            distance[rng.random(k) < 0.5] = rng.choice(NOT_FINITE)
        elif s == "below zero":
            distance = -distance
        elif s == "huge":
            distance[:] = rng.choice([4.0, 4.1, 1e9, 1e308])
        elif s == "failing":
            status = self.status
        elif s in ("stale", "old", "future", "backwards", "no stamps"):
            stamp = {
                "stale": np.full(k, self.began), "old": stamp - rng.choice([0.02, 0.07, 1.0], k), "future": stamp + 0.1,
                "backwards": 2 * self.began - stamp, "no stamps": rng.choice([np.nan, -np.inf, np.inf, now], k),
            }[s]  # fmt: skip
        return RangeReadings(stamp, distance, status)

    def wrench(self) -> np.ndarray | None:
        """Return what the arm feels."""
        w = np.zeros(6)
        w[:3] = self.rng.normal(scale=0.3, size=3)
        f = self.feel
        if f == "none":
            return None
        if f == "push":
            w[:3] += self.push
        elif f == "steps":
            w[:3] = self.push * (self.left % 2)
        elif f in ("huge", "beyond"):
            w[self.left % 3] = -9e4 if f == "huge" else 1e5
        elif f in ("nan", "inf", "torque"):
            w[5 if f == "torque" else self.left % 3] = np.inf if f == "inf" else np.nan
        elif f == "denormal":
            w[:] = 5e-324
        return w

    def torques(self) -> object:
        """Return what the arm's joints feel; the force may say something else."""
        torque, f = self.rng.normal(scale=0.3, size=7), self.feel
        if f == "none":
            return None if self.left % 2 else np.zeros(3)
        if f in ("push", "torque"):
            torque += self.strain
        elif f == "steps":
            torque += self.strain * (-1.0) ** (self.left // 4)
        elif f in ("huge", "beyond"):
            torque[self.left % 7] = -9e3 if f == "huge" else 1e4
        elif f in ("nan", "inf"):
            torque[self.left % 7] = np.nan if f == "nan" else np.inf
        elif f == "denormal":
            torque[:] = 5e-324
        return torque


def spoiled(inputs: Inputs, fault: str, value: float, joint: int = 3) -> Inputs:
    """The same inputs with one thing wrong."""
    robot, now = inputs.robot, inputs.stamp
    if fault in ("q", "qd", "q_commanded", "qd_commanded", "wrench"):
        wrong = getattr(robot, fault).copy()
        wrong[joint] = value
        return replace(inputs, robot=replace(robot, **{fault: wrong}))
    if fault in ("step stamp", "backwards", "jump", "overrun"):
        stamps = {"step stamp": value, "backwards": now - 1.0, "jump": now + 60.0, "overrun": now}
        return replace(inputs, stamp=stamps[fault])
    stamps = {"robot stamp": value, "stale": now - 1.5, "future": now + 1.5}
    return replace(inputs, robot=replace(robot, stamp=stamps[fault]))
