"""Limits of velocity commands to a Franka arm, one a millisecond, and thresholds at which it stops by itself.

The arm's own collision reflex lies above our thresholds, or it would stop the arm before we react.

The vendor holds the *whole* estimate against fixed thresholds. With the paper's detection ours are about the mean of a
window (eq. 9), so the largest reading at which we react, on one axis, is `f_base + f_std` (13 N in the paper) above the
largest mean:

- the mean in free motion is at most `BIAS_N`: real Pandas show 0.4 to 1.7 N per axis with nothing attached
  (franka_ros issue 404), and a slow drift with the posture of 2 to 5 N when they move;
- the arm reports a contact from `LOWER_ABOVE_N` above that, so that what it calls a contact is one for us too;
- and stops by itself from `UPPER_ABOVE_N` above: between our threshold and the arm yielding lie up to 0.17 s of the
  filtered comparison, in which the force of a push still grows. For the paper's parameters that is 48 N, between the
  40 N below which a reaction comes too late and the 60 N that a hand meets at 0.3 m/s.

The sequential test has no threshold: it is least sensitive while it has learnt nothing. The largest force on one axis
that it may then miss at the arm's ready posture is 38 N with the profile `pretouch`; once it has learnt, 4 to 9 N on a
simulated Panda. The arm stops by itself `UPPER_ABOVE_N` above that, but from `MOST_N` on at the latest: with an error
of `BIAS_N` that is the 65 N of ISO/TS 15066 for a face, the least of its quasi-static figures. By then an arm that is
pushed yields at 0.27 m/s at least in any direction; its limit is 0.3 m/s.

Joint torques are those of such a force at the end-effector with the longest lever its joint ever has, but at least the
figures of the vendor's examples, which are above the noise of the estimate (20 20 18 18 16 14 12 Nm; libfranka,
`examples_common.cpp`). Moments are to forces as in the same examples, 25 Nm to 20 N.
"""

from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np

from pretouch.checks import Check, Checked, Fraction, NonNegative, Positive
from pretouch.contact.detector import Body
from pretouch.contact.sequential_test import SequentialTest
from pretouch.errors import ParameterError
from pretouch.profiles import Profile
from pretouch.robot.description import RobotDescription, SpeedEnvelope, fr3, panda
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import spread
from pretouch.sensing.skin import Skin
from pretouch.types import FloatArray

JERK = {"panda": np.array([7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0]), "fr3": np.full(7, 5000.0)}
"""Largest jerk of each joint [rad/s^3]: `kMaxJointJerk` in `rate_limiting.h` of libfranka 0.9, and 0.21 for the FR3."""

_ARMS = {"panda": panda, "fr3": fr3}
_VENDOR_NM = np.array([20.0, 20.0, 18.0, 18.0, 16.0, 14.0, 12.0])
"""Joint torques of the vendor's examples [Nm]."""
_MOMENT_M = 1.25
"""Moment to force in the vendor's examples [m]."""
_UPPER_SHARE = 1.5
"""Least ratio of an upper joint threshold to the vendor's figure."""
_POSTURES = 1000
BIAS_N = 5.0
"""Largest mean of the force estimate in free motion, per axis [N]."""
LOWER_ABOVE_N = 10.0
"""Distance from our largest threshold to the arm's lower one [N]."""
UPPER_ABOVE_N = 30.0
"""Distance from our largest threshold to the arm's upper one, at which it stops by itself [N]."""
MOST_N = 60.0
"""Most that upper one may be with the sequential detector [N]."""

Share = Annotated[float, Check(low=0.01, high=0.9)]


@dataclass(frozen=True)
class LimiterParams(Checked):
    """Parameters of the motion from one set-point to the next."""

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
class FrankaLimits:
    """Limits that the arm accepts, (7,) each."""

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


def motion_limits(model: RobotModel, kind: str) -> FrankaLimits:
    """Return the limits of an arm; `kind` is "panda" or "fr3".

    Accelerations are the vendor's: those of the model may be what a controller is told (`planned`).
    """
    arm = model.description
    return FrankaLimits(arm.qd_max, _ARMS[kind]().qdd_max, JERK[kind], model.q_min, model.q_max, arm.envelope)


def planned(description: RobotDescription, params: LimiterParams) -> RobotDescription:
    """Return the limits for a controller: of the accelerations, the share that is used on the way."""
    return replace(description, qdd_max=params.acceleration_share * description.qdd_max)


@dataclass(frozen=True)
class FrankaParams(Checked):
    """Settings of the process that speaks with the arm."""

    limiter: LimiterParams = field(default_factory=LimiterParams)
    """Motion from one set-point to the next."""
    stale_after_s: Positive = 0.05
    """Age at which a set-point no longer counts, and the arm is brought to rest [s]: five periods of a controller at
    100 Hz, from which on the controller itself brakes (`FailureParams.overrun_s`)."""
    end_after_s: Positive = 1.0
    """Age of the newest set-point at which the motion is ended, and has to be begun anew [s]: a program that was
    stopped for that long does not know where the arm is, nor who stands there by now."""


@dataclass(frozen=True)
class CollisionBehavior:
    """Thresholds at which the arm reports a contact (lower) and stops (upper), in the vendor's order."""

    lower_torque: FloatArray
    """(7,) [Nm]"""
    upper_torque: FloatArray
    """(7,) [Nm]"""
    lower_force: FloatArray
    """(6,) forces [N] and moments [Nm]."""
    upper_force: FloatArray
    """(6,) forces [N] and moments [Nm]."""


def largest_threshold(profile: Profile, model: RobotModel) -> float:
    """Largest force on one axis at which our detection may still be silent [N]."""
    body = Body(model, Skin((), model), profile.task.control_period_s)
    missed = profile.detect.largest_missed_n(body, profile.task.speed_m_s)
    # the estimate's bias moves a threshold on the force, and is learnt by a test on torques
    return missed if profile.detect.by_torques else missed + BIAS_N


def collision_behavior(profile: Profile, model: RobotModel) -> CollisionBehavior:
    """Return thresholds for the arm that leave room for our reaction; see the top of this file."""
    ours = largest_threshold(profile, model)
    lower, upper = ours + LOWER_ABOVE_N, ours + UPPER_ABOVE_N
    if isinstance(profile.detect, SequentialTest):
        upper = min(upper, MOST_N)
        lower = min(lower, 0.5 * (ours + upper))
    if not ours < upper:  # nor for a detector that says it misses NaN or everything
        raise ParameterError(
            f"The profile {profile.name} may miss {ours:.0f} N before it has learnt anything, but the arm must stop by"
            f" itself from {upper:g} N on: make its detection more sensitive, by smaller priors of free motion or more"
            " detect.false_alarms_per_hour."
        )
    levers, shape = longest_levers(model), np.array([1.0, 1.0, 1.0, _MOMENT_M, _MOMENT_M, _MOMENT_M])
    return CollisionBehavior(
        lower_torque=np.maximum(lower * levers, _VENDOR_NM),
        upper_torque=np.maximum(upper * levers, _UPPER_SHARE * _VENDOR_NM),
        lower_force=lower * shape,
        upper_force=upper * shape,
    )


def longest_levers(model: RobotModel) -> FloatArray:
    """Largest torque (n,) on each joint [Nm] that 1 N at the end-effector gives in any posture, to a few per cent."""
    longest = np.zeros(model.n)
    for q in model.q_min + spread(_POSTURES, model.n) * (model.q_max - model.q_min):
        jacobian = model.ee_jacobian(model.kinematics(q))
        longest = np.maximum(longest, np.linalg.norm(jacobian[:3], axis=0))
    return longest
