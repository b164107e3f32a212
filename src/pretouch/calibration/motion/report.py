"""How long a planned motion takes, and how much room: to be read before the arm moves."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.motion.limits import RATE_HZ, MotionLimits, point_speed
from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import capsule_ends, kinematics_of
from pretouch.types import FloatArray


@dataclass(frozen=True, eq=False)
class PlanReport:
    """A motion in figures."""

    duration: float
    """[s]"""
    standing: float
    """Time in which the arm stands [s]."""
    low: FloatArray
    """(3,) lowest coordinates of the box that the moving links stay in [m], base frame."""
    high: FloatArray
    """(3,) highest coordinates of that box [m]."""
    nearest: float
    """Least distance between parts of the arm [m]."""
    floor: float
    """Least distance from the floor [m]."""
    speed: float
    """Largest speed of any part [m/s]."""

    def __str__(self) -> str:
        ranges = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", self.low, self.high, strict=True))
        return (
            f"{self.duration:.0f} s, {self.standing:.0f} s of them at rest; parts move at up to {self.speed:.2f} m/s.\n"
            f"The arm needs the space {ranges} m (base frame) and comes within {self.nearest:.3f} m of itself and"
            f" {self.floor:.3f} m of the floor."
        )


def report_on(model: RobotModel, plan: Plan, params: PlanParams) -> PlanReport:
    """Say how long a motion takes, and how much room.

    Args:
        model: the arm.
        plan: the motion.
        params: for the height of the floor.
    """
    samples, body = plan.sampled(RATE_HZ), model.capsules
    ends = capsule_ends(model, kinematics_of(model, samples.q))
    distances = MotionLimits(model, params).distances(ends).min(axis=0)
    moving = np.isin(body.link, model.body.link)
    radius = body.radius[moving][:, None, None]
    return PlanReport(
        duration=plan.duration,
        standing=sum(end - begin for begin, end in plan.still),
        low=(ends[:, moving] - radius).min(axis=(0, 1, 2)),
        high=(ends[:, moving] + radius).max(axis=(0, 1, 2)),
        nearest=float(distances[:-1].min()),
        floor=float(distances[-1]),
        speed=point_speed(ends, samples.time),
    )
