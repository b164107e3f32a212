"""Parameters of the task: following the path, and the cost of the QP (eq. 2)."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pretouch.checks import Check, Checked, NonNegative, Positive, PositiveCount

Orientation = Literal["free", "hold"]


@dataclass(frozen=True)
class TaskParams(Checked):
    """Following the path, and the cost of the QP (eq. 2)."""

    speed_m_s: Positive = 0.3
    """Largest end-effector speed along the path [m/s] (paper, IV-A)."""
    acceleration_m_s2: Positive = 1.0
    """Rate at which the speed along the path may grow [m/s^2]; slowing is not limited by it."""
    restore_cycles: PositiveCount = 200
    """Control cycles l_max of eq. 4 until full speed is back after what slowed the arm is gone (Table I, 100 Hz)."""
    position_gain_1_s: NonNegative = 2.0
    """Velocity towards the path per metre off it [1/s]."""
    off_path_m: Positive = 0.1
    """Distance from the path at which the arm no longer advances along it but only returns [m]."""
    orientation: Orientation = "hold"
    """Whether the task is the hand's velocity alone, or also keeps its orientation at the start. The paper does not
    say. Free, the hand rolls its units out of view of what restricts it (docs/reference/experiments.md)."""
    orientation_gain_1_s: NonNegative = 1.0
    """Angular velocity per radian of orientation error when it is held [1/s]."""
    damping_max: NonNegative = 0.1
    """Nakamura damping lambda_0, the factor mu of eq. 2 at a singularity (authors' code family)."""
    manipulability_threshold: Positive = 0.001
    """Manipulability w_0 below which damping begins (authors' code family)."""
    mid_joint_gain: Positive = 0.001
    """Weight k of the mid-joint term in eq. 2; larger values drag the arm off its path. It also keeps the
    Hessian positive definite."""
    mid_joint_projected: bool = False
    """Whether the mid-joint term acts in the task's null space alone, where it drags nothing; the paper's acts on all
    joint velocities."""
    mid_joint_time_s: Positive = 5.0
    """Time t in which the mid-joint velocity would bring the joints to their middle [s]."""
    control_period_s: Annotated[float, Check(low=1e-4, high=1.0)] = 0.01
    """Period of the controller [s] (paper: 100 Hz)."""
    position_margin_rad: NonNegative = 0.01
    """Distance the commanded joint positions keep from the joint limits [rad]."""
