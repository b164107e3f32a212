"""Where a run begins: whether the arm is near enough to its path, and the slow way there."""

import numpy as np

from pretouch.calibration.motion.params import PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.route import approach
from pretouch.control.path import Path
from pretouch.control.posture import brought_to
from pretouch.controller import Controller
from pretouch.errors import CalibrationError, ExperimentError, RobotError
from pretouch.robot.model import RobotModel
from pretouch.session.finding import Finding
from pretouch.types import FloatArray

_SPEED_M_S = 0.15
_SHARE = 0.2
"""Of the joints' limits, on the way to the start."""
_NEAR_SHARE = 0.5
"""Share of the distance from which the arm no longer advances along its path, up to which it may begin off it."""


def distance(model: RobotModel, q: FloatArray, path: Path) -> float:
    """Distance of the end-effector at q (n,) [rad] from where a path begins [m]."""
    return float(np.linalg.norm(model.kinematics(q).position[model.ee] - path.point(0.0)))


def check_start(controller: Controller, q: FloatArray) -> tuple[Finding, ...]:
    """Say so if an arm at q (n,) [rad] is too far from where its path begins."""
    most = _NEAR_SHARE * controller.profile.task.off_path_m
    away = distance(controller.model, q, controller.path)
    if away <= most:
        return ()
    return (
        Finding(
            "start",
            f"The end-effector is {away:.2f} m from where the path begins, {_point(controller.path)} m (limit"
            f" {most:g} m): guide it there by hand, or let the arm go there slowly with --approach.",
        ),
    )


def way_to_start(model: RobotModel, q: FloatArray, path: Path, floor: float) -> Plan | None:
    """Plan the slow way, straight in joint space, from q (n,) [rad] to where a path begins; None where it is there.

    Raises RobotError where there is none.
    """
    try:
        goal = brought_to(model, path.point(0.0))
        plan = Plan(np.array([0.0, 1.0]), np.array([goal, goal]))
        if np.abs(goal - q).max() < 1e-3:
            return None
        params = PlanParams(speed_share=_SHARE, acceleration_share=_SHARE, speed_m_s=_SPEED_M_S, floor_m=floor)
        return approach(model, q, plan, params)
    except (CalibrationError, ExperimentError) as error:
        raise RobotError(f"There is no way to the start of the path: {error}") from error


def _point(path: Path) -> str:
    return f"({', '.join(f'{value:.2f}' for value in path.point(0.0))})"
