"""Postures for the simulated arm, and units on its hand."""

from collections.abc import Callable

import numpy as np
import pytest
from tests.sim.ranging import FORWARD, NO_ERROR, Rig

from pretouch.robot.model import RobotModel
from pretouch.sensing.sensor import PAPER_SENSOR, Sensor
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant import Plant
from pretouch.sim.range_finder import RangeFinderParams, RangeFinders
from pretouch.sim.scene import Box, HandSpec, SceneSpec
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


@pytest.fixture
def rig(panda_model: RobotModel) -> Callable[..., Rig]:
    def make(*boxes: Box, units: int = 1, hand: HandSpec | None = None, seed: int = 0, link: str = "panda_hand",
             pose: np.ndarray = FORWARD, sensor: Sensor = PAPER_SENSOR, **params: object) -> Rig:  # fmt: skip
        skin = Skin([SensorUnit(f"unit_{i}", link, pose, sensor=sensor) for i in range(units)], panda_model)
        plant = Plant(panda_model, SceneSpec(boxes, hand), NO_ERROR, panda_model.description.q_ready, seed)
        return Rig(plant, RangeFinders(plant, skin, RangeFinderParams(**params), seed))

    return make
