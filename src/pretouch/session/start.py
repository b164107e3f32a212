"""Where a run begins: whether the arm is near enough to its path, and the slow way there."""

import numpy as np

from pretouch.calibration.motion.limits import PlanParams
from pretouch.calibration.motion.plan import Plan
from pretouch.calibration.motion.planner import approach
from pretouch.control.path import Path
from pretouch.controller import Controller
from pretouch.errors import CalibrationError, ExperimentError, RobotError
from pretouch.robot.model import RobotModel
from pretouch.robot.postures import brought_to
from pretouch.session.preflight import Finding
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
            f"The end-effector is {away:.2f} m from the start of the path, {_point(controller.path)} m (limit {most:g}"
            " m): guide it there by hand, or let the arm move there slowly with --approach.",
        ),
    )


def plan_to_start(model: RobotModel, q: FloatArray, path: Path, floor: float) -> Plan | None:
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
        raise RobotError(f"No motion to the start of the path was found: {error}") from error


def _point(path: Path) -> str:
    return f"({', '.join(f'{value:.2f}' for value in path.point(0.0))})"


_PLACES = 200


def announcement(controller: Controller, seconds: float, way: Plan | None, asks: str = "") -> tuple[str, ...]:
    """Say in sentences what the arm will do.

    Args:
        controller: that is going to move it.
        seconds: how long it will [s]; infinite until it is stopped.
        way: the way to the start of its path, if it goes there first.
        asks: what a commander lets it do in place of its path, if one does.
    """
    path, profile = controller.path, controller.profile
    points = np.array([path.point(phase) for phase in np.linspace(0.0, path.length, _PLACES)])
    low, high = points.min(axis=0), points.max(axis=0)
    room = ", ".join(f"{axis} {a:.2f} to {b:.2f}" for axis, a, b in zip("xyz", low, high, strict=True))
    said = []
    if way is not None:
        said.append(
            f"First the arm moves slowly, straight in joint space, to the start of its path ({way.duration:.0f} s)."
            " During this it does not avoid anybody, and stops if it is pushed."
        )
    still = bool(np.all(high - low < 1e-3))
    where = (
        f"The arm keeps its end-effector at ({', '.join(f'{v:.2f}' for v in low)}) m (base frame)."
        if still
        else f"The arm moves its end-effector at up to {profile.task.speed_m_s:g} m/s within {room} m (base frame);"
        " the arm as a whole needs more space."
    )
    said.append(asks or where)
    said.append(profile.react.announced(profile.task.control_period_s))
    said.append(f"It runs for {seconds:g} s." if np.isfinite(seconds) else "It runs until it is stopped.")
    said.append(
        "To stop it, press the user stop, which always works at once; Ctrl-C brings it to rest within its limits and"
        " ends the run."
    )
    return tuple(said)
