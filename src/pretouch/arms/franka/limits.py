"""Within what a Franka arm takes velocity commands, one a millisecond, and the share of it that is used."""

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.robot.description import RobotDescription, SpeedEnvelope, fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

JERK = {
    "panda": np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]),
    "fr3": np.full(7, 5000.0),
}
"""Largest jerk of each joint [rad/s^3]: `kMaxJointJerk` in `rate_limiting.h` of libfranka 0.9, and 0.21 for the FR3."""

_ARMS = {"panda": panda, "fr3": fr3}

Share = Annotated[float, Check(low=0.01, high=0.9)]


@dataclass(frozen=True)
class LimiterParams(Checked):
    """How the way from one set-point to the next is made."""

    acceleration_share: Share = 0.4
    """Share of the arm's acceleration limits that is used. The arm's jerk limits undo all its acceleration within one
    millisecond: with this share, a command that comes late, when the arm has moved on without it, breaks none."""
    jerk_share: Share = 0.15
    """Share of the arm's jerk limits that is used."""
    speed_share: Fraction = 0.94
    """Share of the arm's speed limits that is used: while commands are lost, the arm goes on speeding up."""
    position_margin_rad: NonNegative = 0.003
    """Distance kept from the position limits [rad], less than the controller's."""
    reseed_rad_s: Positive = 1e-5
    """Difference from the arm's own desired velocity at which a command was lost [rad/s]: what an FR3 reports is
    rounded to 1e-7 of its size."""


@dataclass(frozen=True)
class MotionLimits:
    """What the arm takes, (7,) each."""

    qd_max: FloatArray
    """[rad/s]"""
    qdd_max: FloatArray
    """[rad/s^2]"""
    qddd_max: FloatArray
    """[rad/s^3]"""
    q_min: FloatArray
    """[rad]"""
    q_max: FloatArray
    """[rad]"""
    envelope: SpeedEnvelope | None
    """Speed limits that depend on the position."""


def motion_limits(model: RobotModel, kind: str) -> MotionLimits:
    """Return the limits of an arm; `kind` is "panda" or "fr3".

    Accelerations are the vendor's: those of the model may be what a controller is told (`planned`).
    """
    arm = model.description
    return MotionLimits(arm.qd_max, _ARMS[kind]().qdd_max, JERK[kind], model.q_min, model.q_max, arm.envelope)


def planned(description: RobotDescription, params: LimiterParams) -> RobotDescription:
    """Return what a controller is to know of an arm: of its accelerations, the share that is used on the way."""
    return replace(description, qdd_max=params.acceleration_share * description.qdd_max)


@dataclass(frozen=True)
class FrankaParams(Checked):
    """Settings of the process that speaks with the arm."""

    limiter: LimiterParams = field(default_factory=LimiterParams)
    """The way from one set-point to the next."""
    stale_after_s: Positive = 0.05
    """Age at which a set-point no longer counts, and the arm is brought to rest [s]: five periods of a controller at
    100 Hz, from which on the controller itself brakes (`FailureParams.overrun_s`)."""
    end_after_s: Positive = 1.0
    """Age of the newest set-point at which the motion is ended, and has to be begun anew [s]: a program that was
    stopped for that long does not know where the arm is, nor who stands there by now."""
