"""State of a Franka arm from the vendor's libraries; the one place where its sign becomes ours."""

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pretouch.types import FloatArray, RobotState

JOINTS = 7
"""Joints of a Panda and of an FR3."""

MODES = ("other", "idle", "move", "guiding", "reflex", "user stopped", "automatic error recovery")
"""The vendor's robot modes, each at its number on the wire."""

STUCK_S = 0.1
"""Time for which a joint's external torque may repeat to the last digit [s]: each of the arm's states has new noise."""
_NAME = re.compile(r"[a-z]\w+")


@dataclass(frozen=True, slots=True)
class FrankaState:
    """One state of the arm in the vendor's terms and signs."""

    time: float
    """Robot time [s]."""
    mode: str
    """One of `MODES`."""
    errors: tuple[str, ...]
    """Errors that are pending, by the vendor's names."""
    last_motion_errors: tuple[str, ...]
    """Errors that ended the last motion; empty if it ended as requested."""
    q: FloatArray
    """(7,) measured joint positions [rad]."""
    qd: FloatArray
    """(7,) measured joint velocities [rad/s]."""
    q_d: FloatArray
    """(7,) joint positions the motion generator is at [rad]."""
    dq_d: FloatArray
    """(7,) joint velocities the motion generator is at [rad/s]."""
    ddq_d: FloatArray
    """(7,) joint accelerations the motion generator is at [rad/s^2]."""
    tau_ext: FloatArray
    """(7,) `tau_ext_hat_filtered` [Nm]: by the arm on its environment."""
    wrench: FloatArray
    """(6,) `O_F_ext_hat_K` [N, Nm], base frame: by the arm on its environment; exactly zero near singularities."""
    success_rate: float
    """Share of the last 100 commands that reached the arm in time; 0 while no motion runs."""
    m_ee: float
    """Mass of the end-effector the arm is told to have [kg]."""
    m_load: float
    """Mass of the load the arm is told to carry [kg]."""


def robot_state(state: FrankaState, stamp: float) -> RobotState:
    """Return a state with our sign, force and torques **on the robot by the environment**, and the caller's stamp [s].

    The vendor's are those by the robot on its environment (libfranka, `robot_state.h`), and a wrench that is exactly
    zero means that there is no estimate, as near a singularity.
    """
    wrench = -state.wrench if state.wrench.any() else None
    return RobotState(stamp, state.q, state.qd, state.q_d, state.dq_d, -state.tau_ext, wrench)


class TorqueWatch:
    """Watches for torques that repeat to the last digit: they are noisy, so a sensor sticks, or all is an old state."""

    def __init__(self) -> None:
        self._last, self._changed = np.full(JOINTS, np.nan), np.full(JOINTS, -np.inf)

    def believed(self, robot: RobotState) -> RobotState:
        """Return an old state with its old stamp, and one of a sensor that sticks without torques and force."""
        new = robot.tau_ext != self._last
        self._changed[new] = robot.stamp
        self._last = robot.tau_ext
        if not new.any():
            robot = replace(robot, stamp=float(self._changed.max()))
        sticks = robot.stamp - self._changed.min() > STUCK_S
        return replace(robot, tau_ext=np.full(JOINTS, np.nan), wrench=None) if sticks else robot


def franka_state(raw: Any) -> FrankaState:
    """Return the state that one of the vendor's libraries gave: both name and number alike what is used here."""
    motion, force = (raw.q, raw.dq, raw.q_d, raw.dq_d, raw.ddq_d), (raw.tau_ext_hat_filtered, raw.O_F_ext_hat_K)
    q, qd, q_d, dq_d, ddq_d, tau_ext, wrench = (np.array(values) for values in (*motion, *force))
    errors, last = _names(raw.current_errors), _names(raw.last_motion_errors)
    time, mode, rate = raw.time.to_sec(), MODES[int(raw.robot_mode)], raw.control_command_success_rate
    return FrankaState(time, mode, errors, last, q, qd, q_d, dq_d, ddq_d, tau_ext, wrench, rate, raw.m_ee, raw.m_load)


def error_names(text: str) -> tuple[str, ...]:
    """Return the vendor's error names in a list that its library printed: `["joint_reflex"]`."""
    start = text.find("[")
    return tuple(_NAME.findall(text[start : text.find("]", start)])) if start >= 0 else ()


def _names(errors: Any) -> tuple[str, ...]:
    return error_names(str(errors)) if errors else ()
