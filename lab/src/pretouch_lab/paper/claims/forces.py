"""True forces on the hand of the simulated arm without anything that touches it: pushes, steps and ramps."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pretouch.sim.plant import Plant
from pretouch.types import FloatArray

Shape = Literal["push", "step", "ramp"]

_PUSH_S = 0.2
_STEP_S = 1.0
_EDGE_S = 0.01
"""Time in which a step rises and falls, and in which a ramp is let go [s]."""
RAMP_TOP_N = 30.0
"""Force at which a ramp is let go [N]."""


@dataclass(frozen=True)
class Event:
    """A force that comes and goes: a half sine of 0.2 s, a step of 1 s, or a ramp up to 30 N."""

    shape: Shape
    size: float
    """Largest force of a push or a step [N], rate of a ramp [N/s]."""
    start: float
    """[s]"""
    direction: FloatArray
    """(3,) unit vector of the force on the arm, base frame."""

    @property
    def peak_n(self) -> float:
        """Largest force [N]."""
        return RAMP_TOP_N if self.shape == "ramp" else self.size

    @property
    def rise_s(self) -> float:
        """Time from the start until the largest force [s]."""
        if self.shape == "ramp":
            return RAMP_TOP_N / self.size
        return _PUSH_S / 2 if self.shape == "push" else _EDGE_S

    @property
    def end(self) -> float:
        """When the force is gone [s]."""
        durations = {"push": _PUSH_S, "step": _STEP_S, "ramp": self.rise_s + _EDGE_S}
        return self.start + durations[self.shape]

    def force_n(self, time: float) -> float:
        """Size of the force [N] at a time [s]."""
        since, left = time - self.start, self.end - time
        if since <= 0.0 or left <= 0.0:
            return 0.0
        if self.shape == "push":
            return self.peak_n * float(np.sin(np.pi * since / _PUSH_S))
        return self.peak_n * min(1.0, since / self.rise_s, left / _EDGE_S)

    def reached_n(self, time: float) -> float:
        """Return the largest force so far [N] at a time [s] after the start."""
        # every shape is largest when its rise is over, just before its fall begins
        return self.force_n(min(time, self.start + self.rise_s))


def apply(plant: Plant, events: tuple[Event, ...]) -> None:
    """Have forces act on a simulated arm at its end-effector's origin, whatever the arm does."""
    model, data = plant.mj_model, plant.mj_data
    body = int(model.body(plant.model.description.ee_body).id)
    # MuJoCo's applied force acts at the body's centre of mass; views, looked up once
    origin, center, wrench = data.xpos[body], data.xipos[body], data.xfrc_applied[body]

    spans = [(event.start, event.end, event) for event in events]

    def before_step(time: float) -> None:
        wrench[:] = 0.0
        for start, end, event in spans:
            if start < time < end:
                force = event.force_n(time) * event.direction
                wrench[:3] += force
                wrench[3:] += np.cross(origin - center, force)

    plant.before_each_step(before_step)
