"""An arm that wanders between random postures, whatever touches it: localisation has to work in any of them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch.controller import Controller, ControllerState
from pretouch.robot.body import placed
from pretouch.types import ControlStep, FloatArray, Inputs
from pretouch_lab.benchmarks.dense_skin import gap
from pretouch_lab.benchmarks.detection.arm import model
from pretouch_lab.benchmarks.scenario_files import scenario

_TRIES = 4000
_ALONG = 12
"""Places looked at on the way from one posture to the next."""
PEAK = 1.875
"""Largest speed of a quintic from rest to rest over its mean speed."""
_PULL_1_S = 2.0
"""Gain on what the arm is off its course [1/s]."""


@dataclass(frozen=True)
class Wandering:
    """M ways from rest to rest, one after the other."""

    q: FloatArray
    """(M + 1, n) postures [rad]."""
    start: FloatArray
    """(M,) when each way begins [s]."""
    duration: FloatArray
    """(M,) how long it takes [s]."""

    def at(self, time: float) -> tuple[FloatArray, FloatArray]:
        """Return joint positions (n,) [rad] and velocities (n,) [rad/s] at a time [s]."""
        k = max(0, int(np.searchsorted(self.start, time, side="right")) - 1)
        s = min(1.0, max(0.0, (time - float(self.start[k])) / float(self.duration[k])))
        way = self.q[k + 1] - self.q[k]
        along = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        return self.q[k] + along * way, 30.0 * (s * (1.0 - s)) ** 2 / float(self.duration[k]) * way


def wandering(seed: int, until: float) -> Wandering:
    """Draw the motion of an arm for so long [s]; the seed says which."""
    chosen, rng = scenario("localization")["motion"], np.random.default_rng([seed, 41])
    q, start, duration, at = [posture(rng, None)], [], [], 1.0
    while at < until:
        after = posture(rng, q[-1])
        fastest = float(np.abs(after - q[-1]).max())
        start.append(at)
        duration.append(PEAK * fastest / rng.uniform(*chosen["speed_rad_s"]))
        at += duration[-1] + rng.uniform(*chosen["rest_s"])
        q.append(after)
    return Wandering(np.array(q), np.array(start), np.array(duration))


def posture(rng: np.random.Generator, before: FloatArray | None) -> FloatArray:
    """Draw a posture (n,) that is free, as is the straight way to it; where none is found it is the one before."""
    arm, part = model(), scenario("localization")["motion"]["range"]
    for _ in range(_TRIES):
        q = np.asarray(arm.q_mid + part * (arm.q_max - arm.q_min) / 2 * rng.uniform(-1, 1, arm.n))
        ways = [q] if before is None else [before + k / _ALONG * (q - before) for k in range(_ALONG, 0, -1)]
        if all(is_free(way) for way in ways):
            return q
    return arm.description.q_ready if before is None else before


def is_free(q: FloatArray) -> bool:
    """Whether the arm is clear of the floor and of itself."""
    chosen, arm = scenario("localization")["motion"], model()
    body = arm.capsules
    _, a, b, _ = placed(body, arm.kinematics(q))
    moves = np.asarray(arm.rigid >= 0)[body.link]
    lowest = np.minimum(a[:, 2], b[:, 2]) - body.radius
    order = arm.moved_by.sum(axis=1)[body.link]
    if lowest[moves & (order > 2)].min() < chosen["floor_m"]:
        return False
    for c in np.flatnonzero(order > 3):
        others = np.flatnonzero(order < order[c] - 2)
        points = np.linspace(a[c], b[c], 5)
        if gap(points, a[others], b[others], body.radius[others]).min() < body.radius[c] + chosen["apart_m"]:
            return False
    return True


class WanderingController(Controller):
    """Sees and judges as any other, but moves along a course whatever that says."""

    def __init__(self, course: Wandering, *given: Any) -> None:
        """Take the course, and what any controller is made of."""
        super().__init__(*given)
        self.course = course

    def step(self, state: ControllerState, inputs: Inputs) -> tuple[ControlStep, ControllerState]:
        """Run one control cycle and command the course in place of what it decided."""
        step, after = super().step(state, inputs)
        q, qd = self.course.at(inputs.stamp)
        command = qd + _PULL_1_S * (q - after.robot.q_commanded)
        memory = after.memory.copy()
        memory.put("command", command)
        return replace(step, command=command), replace(after, memory=memory)
