"""Reference motion of one step: along the path, or by a commander in its place."""

import math

import numpy as np

from pretouch.desired import Desired, DesiredKind
from pretouch.params import TaskParams
from pretouch.robot.kinematics import Kinematics
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray, RobotState
from pretouch.values import value

_TURN_RAD = 1.0
"""Largest angle to a requested orientation in one step: the sine of `rotation_error` falls beyond a right angle."""


@value
class MotionReference:
    """Reference motion before any limit."""

    velocity: FloatArray
    """(3,) velocity of the end-effector origin [m/s]."""
    point: FloatArray
    """(3,) desired position on the path; the actual position with a commander [m]."""
    rotation_goal: FloatArray
    """(3, 3) R_O_ee to turn to."""
    lasting_rotation: FloatArray
    """(3, 3) R_O_ee to hold after this step without another request."""
    qd: FloatArray | None = None
    """(n,) joint velocities that replace the other fields [rad/s]."""


def reference_of(
    desired: Desired,
    now: float,
    kin: Kinematics,
    robot: RobotState,
    model: RobotModel,
    orientation: FloatArray,
    params: TaskParams,
    scale: float,
) -> MotionReference:
    """Return the reference of a commander's desired motion at an instant [s], with a factor on its speed.

    `orientation` is R_O_ee (3, 3) to hold without another request. A position is approached as the path is: with
    `position_gain_1_s`, no faster than `speed_m_s` at the end-effector.
    """
    number, rate = _at(desired, now)
    R, here, gain = kin.rotation[model.ee], kin.position[model.ee], params.position_gain_1_s
    if desired.kind is DesiredKind.TWIST:
        if not number[3:].any():
            return MotionReference(scale * number[:3], here, orientation, orientation)
        speed = float(np.linalg.norm(number[3:]))
        share = speed / params.orientation_gain_1_s if params.orientation_gain_1_s > 0.0 else 0.0
        goal = rotation_about(number[3:] / speed, math.asin(min(1.0, share))) @ R  # to it the gain answers so fast
        return MotionReference(scale * number[:3], here, goal, R)
    if desired.kind is DesiredKind.POSE:
        velocity = rate[:3] + gain * (number[:3] - here)
        share = scale * _share(velocity, rate[:3], params)
        return MotionReference(share * velocity, here, _rotation_towards(R, number[3:].reshape(3, 3)), R)
    J, qd, share = model.ee_jacobian(kin)[:3], number, scale
    if desired.kind is DesiredKind.JOINT_POSITIONS:
        qd = rate + gain * (number - robot.q_commanded)
        share *= _share(J @ qd, J @ rate, params)
    return MotionReference(share * (J @ qd), here, R, R, share * qd)


def _at(desired: Desired, now: float) -> tuple[FloatArray, FloatArray]:
    """Return the desired value at an instant, and its rate of change [1/s]; 0 for velocities."""
    stamp, number = desired.stamp, desired.number
    i = int(np.searchsorted(stamp, now, side="right"))
    still = np.zeros(number.shape[1])
    if desired.kind in (DesiredKind.TWIST, DesiredKind.JOINT_VELOCITIES) or i in (0, len(stamp)):
        return number[max(0, i - 1)], still
    rate = (number[i] - number[i - 1]) / (stamp[i] - stamp[i - 1])
    between = number[i - 1] + rate * (now - stamp[i - 1])
    if desired.kind is DesiredKind.POSE:
        between[3:] = number[i, 3:]  # an interpolation of the elements would be no rotation
    return between, rate


def _share(velocity: FloatArray, planned: FloatArray, params: TaskParams) -> float:
    """Share of a velocity (3,) [m/s] that is no faster than the task's, or than the plan's where that is faster."""
    length, fastest = float(np.linalg.norm(velocity)), max(params.speed_m_s, float(np.linalg.norm(planned)))
    return 1.0 if length <= fastest else fastest / length


def _rotation_towards(R: FloatArray, goal: FloatArray) -> FloatArray:
    """Return the goal, or an orientation on the way to a distant one."""
    difference = goal @ R.T
    angle = math.acos(max(-1.0, min(1.0, 0.5 * (float(np.trace(difference)) - 1.0))))
    if angle <= _TURN_RAD:
        return goal
    skew = difference - difference.T
    axis = np.array((skew[2, 1], skew[0, 2], skew[1, 0]))
    if np.linalg.norm(axis) < 1e-6:  # half a turn: any column of (D + I) is along the axis
        both = difference + np.eye(3)
        axis = both[:, int(np.argmax(np.diag(both)))]
    return rotation_about(axis / np.linalg.norm(axis), _TURN_RAD) @ R


def rotation_about(axis: FloatArray, angle: float) -> FloatArray:
    """Rotation (3, 3) about a unit axis (3,) by an angle [rad] (Rodrigues)."""
    x, y, z = axis
    K = np.array(((0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)))
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * (K @ K)
