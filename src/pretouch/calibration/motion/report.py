"""What a planned motion is good for, and the room it takes: to be read before the arm moves."""

from dataclasses import dataclass

import numpy as np

from pretouch.calibration.motion.information import Observability
from pretouch.calibration.motion.limits import RATE_HZ, MotionLimits, point_speed
from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.robot.model import RobotModel
from pretouch.robot.self_distance import capsule_ends, kinematics_of
from pretouch.types import FloatArray


@dataclass(frozen=True)
class LinkOutlook:
    """How well the pose of a unit in the middle of a link is going to be known."""

    link: str
    position_sigma: float
    """Standard deviation of its position in the worst direction [m]."""
    orientation_sigma: float
    """Standard deviation of its orientation about the worst axis [rad]."""


@dataclass(frozen=True, eq=False)
class PlanReport:
    """A motion in figures."""

    duration: float
    """[s]"""
    standing: float
    """Time in which the arm stands [s]."""
    outlook: tuple[LinkOutlook, ...]
    """For each link of which the motion can tell all, base first."""
    not_known: tuple[str, ...]
    """Links that one joint alone moves: no motion tells where along its axis a unit sits."""
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
        lines = [
            f"{self.duration:.0f} s, {self.standing:.0f} s of them at rest; parts move at up to {self.speed:.2f} m/s.",
            f"The arm needs the space {ranges} m (base frame) and comes within {self.nearest:.3f} m of itself and"
            f" {self.floor:.3f} m of the floor.",
            f"{'expected sigma':18}{'position':>10}{'orientation':>14}",
        ]
        for item in self.outlook:
            degrees = np.rad2deg(item.orientation_sigma)
            lines.append(f"{item.link:18}{1e3 * item.position_sigma:7.2f} mm{degrees:10.3f} deg")
        lines += [f"{link:18}not where along the axis of the only joint that moves it" for link in self.not_known]
        return "\n".join(lines)


def report_on(model: RobotModel, plan: Plan, params: PlanParams) -> PlanReport:
    """Say what a motion tells of units on each link, and the room it takes.

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
    knowledge = Observability(model)
    place, turn = knowledge.sigmas(knowledge.prior + knowledge.of_plan(plan))
    names = [model.links[link] for link in knowledge.links.tolist()]
    rest = np.setdiff1d(model.body.link, knowledge.links)
    return PlanReport(
        duration=plan.duration,
        standing=sum(end - begin for begin, end in plan.still),
        outlook=tuple(map(LinkOutlook, names, place.tolist(), turn.tolist())),
        not_known=tuple(model.links[link] for link in rest.tolist()),
        low=(ends[:, moving] - radius).min(axis=(0, 1, 2)),
        high=(ends[:, moving] + radius).max(axis=(0, 1, 2)),
        nearest=float(distances[:-1].min()),
        floor=float(distances[-1]),
        speed=point_speed(ends, samples.time),
    )
