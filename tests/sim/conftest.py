"""Postures for the simulated arm."""

from collections.abc import Callable

import numpy as np
import pytest

from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

Reach = Callable[[tuple[float, float, float]], FloatArray]


@pytest.fixture(scope="session")
def reach(panda_model: RobotModel) -> Reach:
    """Joint positions (7,) that bring the end-effector to a point [m], from the ready posture."""

    def to(goal: tuple[float, float, float]) -> FloatArray:
        q = panda_model.description.q_ready.copy()
        for _ in range(500):
            kin = panda_model.kinematics(q)
            error = np.array(goal) - kin.position[panda_model.ee]
            if np.linalg.norm(error) < 1e-6:
                return q
            q = q + np.clip(np.linalg.pinv(panda_model.ee_jacobian(kin)[:3]) @ error, -0.05, 0.05)
        raise AssertionError(f"{goal} is out of reach")

    return to
