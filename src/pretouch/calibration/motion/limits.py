"""Parameters of a calibration motion, and its check against limits, self-collision and the floor."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from pretouch.calibration.motion.plan import Plan, PlanSamples
from pretouch.checks import Check, Checked, NonNegative, Positive
from pretouch.errors import CalibrationError
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import capsule_ends, kinematics_of, self_distances
from pretouch.types import BoolArray, FloatArray

RATE_HZ = 50.0
"""Instants a second at which a motion is looked at [Hz]."""
_USED = 0.98
"""Share of a speed or acceleration limit that samples may use: between them it can be a little more."""
_BEND = 0.2
"""A distance may be less between samples than at them, by this share of its largest second difference: an eighth where
that is steady, and some more."""


@dataclass(frozen=True)
class PlanParams(Checked):
    """Parameters of a calibration motion and its margins. Values without a source are ours."""

    poses: Annotated[int, Check(low=1, high=10)] = 4
    """Postures in which the arm stands for a while, beside its start, and then swings: all joints at once, by two sines
    each."""
    swing_s: Annotated[float, Check(low=5.0, high=30.0)] = 10.0
    """Duration of each swing [s]."""
    reach_rad: Positive = 0.5
    """Furthest from its position at the start [rad] a joint is where the arm stands: less, and the arm needs less room.
    Swings go beyond."""
    margin_rad: NonNegative = 0.1
    """Distance kept from joint limits, and from where a speed envelope lets a joint no longer move [rad]."""
    speed_share: Annotated[float, Check(low=0.0, high=1.0, open_low=True)] = 0.5
    """Share of the joint velocity and acceleration limits that is used."""
    speed_m_s: Positive = 0.7
    """Largest speed of any part of the arm [m/s]."""
    clearance_m: NonNegative = 0.03
    """Distance kept between parts of the arm, and from the floor [m]."""
    floor_m: Annotated[float, Check()] = 0.0
    """Height of what is below the arm, base frame [m]: by default what the base stands on."""
    variant: Annotated[int, Check(low=0, high=1000)] = 0
    """Another number, another motion: of use where the room does not allow the one that was planned."""


class PlanLimits:
    """Limits of the motions of one arm."""

    def __init__(self, model: RobotModel, params: PlanParams) -> None:
        """Take an arm; margins that leave a joint nothing of its range are a CalibrationError."""
        arm, self.model, self.params = model.description, model, params
        low, high = model.q_min, model.q_max
        if arm.envelope is not None:  # within its sides the joints may move both ways
            still = arm.envelope.offset**2 / arm.envelope.slope
            low, high = np.maximum(low, arm.envelope.q_lower + still), np.minimum(high, arm.envelope.q_upper - still)
        self.q_min: FloatArray = low + params.margin_rad
        self.q_max: FloatArray = high - params.margin_rad
        narrowest = int(np.argmin(high - low))
        if self.q_min[narrowest] >= self.q_max[narrowest]:
            raise CalibrationError(
                f"A margin of {params.margin_rad:g} rad at both ends uses up the whole range of"
                f" {model.joints[narrowest]}, {high[narrowest] - low[narrowest]:.3g} rad: choose a smaller margin_rad."
            )
        self.qd_max: FloatArray = params.speed_share * arm.qd_max
        self.qdd_max: FloatArray = params.speed_share * arm.qdd_max
        self._moving: BoolArray = np.isin(model.capsules.link, model.body.link)

    def use(self, samples: PlanSamples) -> tuple[float, float]:
        """Largest shares of what is allowed that a motion uses: of a velocity, and of an acceleration. 1 is all."""
        speed = np.abs(samples.qd) / self._speed_at(samples)
        fastest = point_speed(self._ends(samples), samples.time) / self.params.speed_m_s
        return max(float(speed.max()), fastest) / _USED, float((np.abs(samples.qdd) / self.qdd_max).max()) / _USED

    def _ends(self, samples: PlanSamples) -> FloatArray:
        """Ends of the capsules' axes (T, C, 2, 3) [m] along a motion."""
        return capsule_ends(self.model, kinematics_of(self.model, samples.q))

    def _speed_at(self, samples: PlanSamples) -> FloatArray:
        """Largest joint velocities (T, n) allowed along a motion [rad/s], by position and direction."""
        envelope = self.model.description.envelope
        if envelope is None:
            return np.broadcast_to(self.qd_max, samples.q.shape)
        distance = np.where(samples.qd > 0, envelope.q_upper - samples.q, samples.q - envelope.q_lower)
        allowed = np.maximum(0.0, np.sqrt(envelope.slope * np.maximum(distance, 0.0)) - envelope.offset)
        return np.minimum(self.qd_max, self.params.speed_share * allowed + 1e-9)

    def broken(self, plan: Plan) -> str | None:
        """Say which limit a motion does not keep, as a clause, or None."""
        samples = plan.sampled(RATE_HZ)
        beyond = np.maximum(self.q_min - samples.q, samples.q - self.q_max).max(axis=0)
        if beyond.max() > 0.0:
            joint = self.model.joints[int(beyond.argmax())]
            return f"{joint} comes closer to its limit than {self.params.margin_rad:g} rad"
        velocity, acceleration = self.use(samples)
        if max(velocity, acceleration) > 1.0:
            return f"it needs {max(velocity, acceleration):.2f} times the allowed speed or acceleration"
        ends = self._ends(samples)
        lowest = ends[..., 2][:, self._moving].min(axis=2) - self.model.capsules.radius[self._moving]
        height = lowest.min(axis=1, keepdims=True) - self.params.floor_m
        distances = np.hstack([self_distances(self.model, ends), height])
        nearest = distances.min(axis=0) - _BEND * np.abs(np.diff(distances, 2, axis=0)).max(axis=0, initial=0.0)
        pair = int(np.argmin(nearest))
        if nearest[pair] >= self.params.clearance_m:
            return None
        names = "the arm and the floor"
        if pair < len(self.model.apart):
            names = " and ".join(self.model.links[i] for i in self.model.capsules.link[self.model.apart[pair]])
        return f"{names} come within {nearest[pair]:.3f} m of each other (clearance_m is {self.params.clearance_m:g} m)"

    def room(self, plan: Plan) -> str:
        """Say in what box the moving links stay, base frame."""
        ends, radius = self._ends(plan.sampled(RATE_HZ)), self.model.capsules.radius[self._moving][:, None, None]
        low, high = ((ends[:, self._moving] + side * radius) for side in (-1, 1))
        box = zip("xyz", low.min(axis=(0, 1, 2)), high.max(axis=(0, 1, 2)), strict=True)
        return ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in box)

    def report(self, plan: Plan) -> str:
        """Say how long a motion takes, how fast it is and how much room it needs, to be read before the arm moves."""
        samples = plan.sampled(RATE_HZ)
        speed = point_speed(self._ends(samples), samples.time)
        return (
            f"{plan.duration:.0f} s; parts move at up to {speed:.2f} m/s.\nThe arm needs the space {self.room(plan)} m"
            " (base frame)."
        )


def point_speed(ends: FloatArray, time: FloatArray) -> float:
    """Largest speed [m/s] of the ends of the capsules' axes (T, C, 2, 3) from one instant (T,) [s] to the next."""
    way = np.linalg.norm(np.diff(ends, axis=0), axis=-1)
    return float((way / np.diff(time)[:, None, None]).max())
