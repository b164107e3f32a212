"""What a filter left of what was asked, and whether it kept the limits."""

import numpy as np

from pretouch.control.joint_box import JointLimits
from pretouch.desired import Desired, DesiredKind
from pretouch.params import FailureParams
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.sound import sound_desired
from pretouch.types import FloatArray

TOLERANCE = 1e-9
"""By how much a joint may pass a limit of position [rad], velocity [rad/s] or acceleration [rad/s, in a period] before
that counts: rounding."""


def asked_velocity(asked: Desired | None, now: float, model: RobotModel, kin: Kinematics) -> FloatArray | None:
    """Velocity (3,) of the end-effector origin that is asked for [m/s]; None if nothing sound and new is."""
    sound, _ = sound_desired(asked, model.n, now)
    if sound is None or now - sound.stamp[-1] > FailureParams().desired_timeout_s:
        return None
    if sound.kind is DesiredKind.TWIST:
        return sound.number[0, :3]
    if sound.kind is DesiredKind.JOINT_VELOCITIES:
        return np.asarray(model.ee_jacobian(kin)[:3] @ sound.number[0])
    return None


def breaks_limits(q: FloatArray, before: FloatArray, command: FloatArray, limits: JointLimits) -> bool:
    """Whether a command breaks a limit of a joint.

    Args:
        q: (n,) commanded positions when it ends [rad].
        before: (n,) command before it [rad/s].
        command: (n,) [rad/s].
        limits: those of the controller, its margin at the ends of the joints included.
    """
    slow = np.abs(command) <= limits.qd_max + TOLERANCE
    smooth = np.abs(command - before) <= limits.qdd_max * limits.period + TOLERANCE
    inside = (q >= limits.q_min - TOLERANCE) & (q <= limits.q_max + TOLERANCE)
    return not bool((slow & smooth & inside).all())
