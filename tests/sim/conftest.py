"""Units on the hand of the simulated arm."""

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


@pytest.fixture
def rig(panda_model: RobotModel) -> Callable[..., Rig]:
    def make(*boxes: Box, units: int = 1, hand: HandSpec | None = None, seed: int = 0, link: str = "panda_hand",
             pose: np.ndarray = FORWARD, sensor: Sensor = PAPER_SENSOR, **params: object) -> Rig:  # fmt: skip
        skin = Skin([SensorUnit(f"unit_{i}", link, pose, sensor=sensor) for i in range(units)], panda_model)
        plant = Plant(panda_model, SceneSpec(boxes, hand), NO_ERROR, panda_model.description.q_ready, seed)
        return Rig(plant, RangeFinders(plant, skin, RangeFinderParams(**params), seed), skin)

    return make
