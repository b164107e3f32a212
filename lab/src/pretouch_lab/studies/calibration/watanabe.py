"""The calibration of Watanabe et al. (IROS 2021, arXiv 2110.14516), by accelerometers only, re-implemented.

A unit has six Denavit-Hartenberg parameters after its joint: two of a virtual joint and four of its own. What is
minimised is the static error, of gravity in standing postures turned into the base frame, plus the dynamic error, of
accelerations while joints move; each is a mean of squares [m^2/s^4]. Neither bias nor scale nor clock is estimated.

Where this differs from the authors' program: joint velocities and accelerations come from measured joint positions,
both sides low-passed alike, as in our own calibration; all instants of a motion count, not four of each swing; and
several joints may move at once. The global search is theirs in kind, many local searches from a low-discrepancy
sequence, without NLopt's single linkage. Each of these is meant to help the method.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import qmc

from pretouch.calibration.data import CalibrationData, UnitData
from pretouch.calibration.link_motion import ArmMotion
from pretouch.calibration.params import CalibrationParams
from pretouch.calibration.signals import FINE_S, smooth, times
from pretouch.errors import ExperimentError
from pretouch.robot.model import RobotModel
from pretouch.traces import on_grid
from pretouch.types import BoolArray, FloatArray

_LARGEST = np.array([np.pi, 0.5, np.pi, 0.5, 0.5, np.pi])
"""Of the parameters at which searches begin [rad, m]."""
_DRAWN_LOG2, _SEARCHES = 9, 10
"""So many starts are drawn, and from so many of the best ones a local search begins."""
_GRAVITY = 9.80665
"""[m/s^2]."""
_EDGE_S = 0.2
"""Left out at either end of an interval in which the arm stands [s]: the low-pass still passes the motion there."""


def watanabe(
    model: RobotModel, data: CalibrationData, still: tuple[tuple[float, float], ...]
) -> tuple[FloatArray, ...]:
    """Find T_link_sensor (4, 4) of each unit.

    Args:
        model: the arm.
        data: what was measured; each unit's link must be known.
        still: intervals in which the arm stood, on the joints' clock [s].
    """
    arm = ArmMotion(model, data.joints, CalibrationParams())
    standing = _intervals(arm.time, still)
    if not any(which.any() for which in standing):
        raise ExperimentError("The arm never stands for 0.5 s: the static error needs some standing postures.")
    return tuple(pose(_search(_residuals(arm, unit, standing))) for unit in data.units)


def pose(parameters: FloatArray) -> FloatArray:
    """Pose (4, 4) of a unit on its link from theta, d of the virtual joint and theta, d, a, alpha of the unit.

    The virtual joint's axis z is the joint's; its a is 0 and its alpha is 90 degrees, or its theta would be the unit's.
    """
    theta, d, *own = parameters
    return _step(theta, d, 0.0, np.pi / 2) @ _step(*own)


def _step(theta: float, d: float, a: float, alpha: float) -> FloatArray:
    """Transform (4, 4) of one joint: turned and moved along z, then along x."""
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1.0]])


def _intervals(time: FloatArray, still: tuple[tuple[float, float], ...]) -> list[BoolArray]:
    return [(time > begin + _EDGE_S) & (time < end - _EDGE_S) for begin, end in still]


def _residuals(arm: ArmMotion, unit: UnitData, standing: list[BoolArray]) -> Callable[[FloatArray], FloatArray]:
    """Return what gives the residuals of six parameters: the sum of their squares is static plus dynamic error."""
    if unit.link is None:
        raise ExperimentError(f"The link of unit {unit.id} is not known: this method cannot find it, name it.")
    motion, sensed = arm.link(arm.model.link_index(unit.link)), _acceleration(unit, arm.time)
    moving = arm.usable & ~np.any(standing, axis=0)
    proper = motion.a + _GRAVITY * motion.R_link_base[:, :, 2]
    # while the arm stands, that is against gravity; the paper compares with the mean, the authors' program with this
    f = np.array([proper[which].mean(axis=0) for which in standing if which.any()])
    measured = np.array([sensed[which].mean(axis=0) for which in standing if which.any()])
    moving_f, lever, moving_measured = proper[moving], motion.lever[moving], sensed[moving]

    def residuals(parameters: FloatArray) -> FloatArray:
        T = pose(parameters)
        R, p = T[:3, :3], T[:3, 3]
        static = (f @ R - measured) / np.sqrt(len(f))
        dynamic = ((moving_f + lever @ p) @ R - moving_measured) / np.sqrt(max(1, len(moving_f)))
        return np.concatenate([static.ravel(), dynamic.ravel()])

    return residuals


def _acceleration(unit: UnitData, at: FloatArray) -> FloatArray:
    """Low-passed acceleration (N, 3) [m/s^2] at stamps (N,)."""
    fine = times(unit.imu.stamp[0], unit.imu.stamp[-1])
    return on_grid(at, fine[0], FINE_S, smooth(unit.imu.stamp, unit.imu.acceleration, fine, CalibrationParams()))


def _search(residuals: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Find the parameters (6,) whose residuals are least, anywhere."""
    drawn = qmc.Sobol(d=len(_LARGEST), scramble=False).random_base2(_DRAWN_LOG2)
    starts = (2 * drawn - 1) * _LARGEST
    errors = [float(np.sum(residuals(start) ** 2)) for start in starts]
    best = [least_squares(residuals, starts[i], method="lm") for i in np.argsort(errors)[:_SEARCHES]]
    return np.asarray(min(best, key=lambda found: found.cost).x)
