"""Perception alone, of an arm that is put where a test wants it."""

import numpy as np

from pretouch.params import PerceptionParams
from pretouch.perception.obstacles import track_init
from pretouch.perception.perceive import perceive, perception_setup
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RangeReadings, RangeStatus

FLOOR = Fixtures(np.array([[0.0, 0.0, 1.0, -0.2]]), no_fixtures().capsules)
TCP = np.array([0.30689, 0.0, 0.48688])
"""End-effector origin in the ready posture, see `test_model.py` [m]."""
HAND_LEFT = TCP + np.array([0.0, 0.108, 0.1034 - 0.045])
"""Where the unit hand_left is in the ready posture; it looks along +y [m]."""
PARAMS = PerceptionParams()


def readings_of(skin: Skin, stamp: float, status: RangeStatus = RangeStatus.OK, **distance: float) -> RangeReadings:
    """Readings of the units that are named; the others are not heard."""
    heard = [unit in distance for unit in skin.ids]
    return RangeReadings(
        np.where(heard, stamp, -np.inf),
        np.array([distance.get(unit, np.nan) for unit in skin.ids]),
        np.where(heard, int(status), int(RangeStatus.NONE)),
    )


class Watcher:
    """Perception in a chosen posture, its state carried along."""

    def __init__(
        self, model: RobotModel, skin: Skin, fixtures: Fixtures = FLOOR, params: PerceptionParams = PARAMS
    ) -> None:
        self.model, self.skin = model, skin
        self.setup = perception_setup(model, skin, fixtures, params)
        self.kin = model.kinematics(model.description.q_ready)
        self.state = track_init(len(skin))

    def take(self, readings: RangeReadings, now: float) -> Obstacles:
        """Take readings in at an instant [s]."""
        self.seen, self.state = perceive(self.state, self.setup, self.kin, readings, now)
        return self.seen.obstacles

    def see(self, now: float, status: RangeStatus = RangeStatus.OK, **distance: float) -> Obstacles:
        """Take new readings of the units that are named."""
        return self.take(readings_of(self.skin, now, status, **distance), now)
