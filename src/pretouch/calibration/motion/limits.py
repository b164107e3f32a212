"""Whether a motion keeps to the limits of an arm, to itself, and above the floor."""

import numpy as np

from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan, PlanSamples
from pretouch.errors import CalibrationError
from pretouch.robot.description import SpeedEnvelope
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


class MotionLimits:
    """What the motions of one arm must keep to."""

    def __init__(self, model: RobotModel, params: PlanParams) -> None:
        """Take an arm; margins that leave a joint nothing of its range are a CalibrationError."""
        arm, self.model, self.params = model.description, model, params
        self._envelope = arm.envelope
        low, high = _range(model)
        self.q_min: FloatArray = low + params.margin_rad
        self.q_max: FloatArray = high - params.margin_rad
        narrowest = int(np.argmin(high - low))
        if self.q_min[narrowest] >= self.q_max[narrowest]:
            raise CalibrationError(
                f"A margin of {params.margin_rad:g} rad at both ends uses up the whole range of"
                f" {model.joints[narrowest]}, {high[narrowest] - low[narrowest]:.3g} rad: choose a smaller margin_rad."
            )
        self.qd_max: FloatArray = params.speed_share * arm.qd_max
        self.qdd_max: FloatArray = params.acceleration_share * arm.qdd_max
        self._moving: BoolArray = np.isin(model.capsules.link, model.body.link)
        pairs = model.capsules.link[model.apart]
        self._pair_names = [f"{model.links[a]} and {model.links[b]}" for a, b in pairs]

    def distances(self, ends: FloatArray) -> FloatArray:
        """Distances (S, P + 1) [m] of the pairs of `RobotModel.apart`, then of the lowest moving part and the floor."""
        lowest = ends[..., 2][:, self._moving].min(axis=2) - self.model.capsules.radius[self._moving]
        height = lowest.min(axis=1, keepdims=True) - self.params.floor_m
        return np.hstack([self_distances(self.model, ends), height])

    def free(self, q: FloatArray) -> BoolArray:
        """Which postures (S,) of S (S, n) [rad] are within the joints' ranges and keep clear of arm and floor."""
        ends = capsule_ends(self.model, kinematics_of(self.model, q))
        return self._in_range(q) & (self.distances(ends).min(axis=1) >= self.params.clearance_m)

    def _in_range(self, q: FloatArray) -> BoolArray:
        return np.all((q >= self.q_min) & (q <= self.q_max), axis=1)

    def use(self, samples: PlanSamples) -> tuple[float, float]:
        """Largest shares of what is allowed that a motion uses: of a velocity, and of an acceleration. 1 is all."""
        ends = capsule_ends(self.model, kinematics_of(self.model, samples.q))
        speed = np.abs(samples.qd) / self._speed_at(samples)
        point = point_speed(ends, samples.time) / self.params.speed_m_s
        return max(float(speed.max()), point) / _USED, float((np.abs(samples.qdd) / self.qdd_max).max()) / _USED

    def _speed_at(self, samples: PlanSamples) -> FloatArray:
        """Largest joint velocities (T, n) allowed along a motion [rad/s], by position and direction."""
        if self._envelope is None:
            return np.broadcast_to(self.qd_max, samples.q.shape)
        return np.minimum(self.qd_max, self.params.speed_share * _allowed(self._envelope, samples) + 1e-9)

    def broken(self, plan: Plan, rate: float = RATE_HZ) -> str | None:
        """Say which limit a motion does not keep, as a clause, or None."""
        samples = plan.sampled(rate)
        if not np.all(self._in_range(samples.q)):
            joint = int(np.argmax(np.maximum(self.q_min - samples.q, samples.q - self.q_max).max(axis=0)))
            return f"{self.model.joints[joint]} comes closer to its limit than {self.params.margin_rad:g} rad"
        velocity, acceleration = self.use(samples)
        if max(velocity, acceleration) > 1.0:
            return f"it needs {max(velocity, acceleration):.2f} times the allowed speed or acceleration"
        return self._too_near(samples)

    def _too_near(self, samples: PlanSamples) -> str | None:
        distances = self.distances(capsule_ends(self.model, kinematics_of(self.model, samples.q)))
        nearest = distances.min(axis=0) - _BEND * np.abs(np.diff(distances, 2, axis=0)).max(axis=0, initial=0.0)
        pair = int(np.argmin(nearest))
        if nearest[pair] >= self.params.clearance_m:
            return None
        names = [*self._pair_names, "the arm and the floor"]
        return (
            f"{names[pair]} come within {nearest[pair]:.3f} m of each other (clearance_m is {self.params.clearance_m:g}"
            " m)"
        )


def _range(model: RobotModel) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest positions (n,) [rad] at which the joints may move both ways."""
    envelope = model.description.envelope
    if envelope is None:
        return model.q_min, model.q_max
    still = envelope.offset**2 / envelope.slope
    return np.maximum(model.q_min, envelope.q_lower + still), np.minimum(model.q_max, envelope.q_upper - still)


def point_speed(ends: FloatArray, time: FloatArray) -> float:
    """Largest speed [m/s] of the ends of the capsules' axes (T, C, 2, 3) from one instant (T,) [s] to the next."""
    way = np.linalg.norm(np.diff(ends, axis=0), axis=-1)
    return float((way / np.diff(time)[:, None, None]).max())


def _allowed(envelope: SpeedEnvelope, samples: PlanSamples) -> FloatArray:
    """Largest velocities (T, n) of an envelope in the direction in which each joint moves [rad/s]."""
    distance = np.where(samples.qd > 0, envelope.q_upper - samples.q, samples.q - envelope.q_lower)
    return np.maximum(0.0, np.sqrt(envelope.slope * np.maximum(distance, 0.0)) - envelope.offset)
