"""Perception alone, of an arm that is put where a test wants it."""

from dataclasses import replace

import numpy as np

from pretouch.control.path import Circle
from pretouch.controller import Controller
from pretouch.faults import put_robot
from pretouch.line import SEE, line_points
from pretouch.params import PerceptionParams
from pretouch.perception.obstacles import TrackState
from pretouch.perception.scene_filter import Fixtures, no_fixtures
from pretouch.profiles import PROFILES
from pretouch.robot.body import Capsules
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.types import Obstacles, RangeReadings, RangeStatus, Report, RobotState, SeenPoints

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
        self.model, self.skin, self.q, self.qd = model, skin, model.description.q_ready, np.zeros(model.n)
        self.controller = Controller(model, skin, fixtures, Circle(), replace(PROFILES["paper"], perception=params))
        self.memory = self.controller.init(self.robot(0.0)).memory
        self.state = self.memory.part("tracks", TrackState)

    def robot(self, now: float) -> RobotState:
        """State of the arm."""
        return RobotState(now, self.q, self.qd, self.q, self.qd, np.zeros(self.model.n), None)

    def take(
        self, readings: RangeReadings, now: float, beside: Capsules | None = None, points: SeenPoints | None = None
    ) -> Obstacles:
        """Take readings and points of outside sources in at an instant [s]."""
        self.now = self.controller.blank.copy()
        self.now.put("stamp", now)
        put_robot(self.now.part("robot", Report), self.robot(now))
        self.now.fill("readings", readings)
        if points is not None:
            blocks = self.controller.fixed.blocks, self.memory.blocks, self.now.blocks
            line_points(*blocks, points, self.controller.beside)
        self.controller.take(self.memory, self.now, beside or self.controller.beside, SEE, SEE)
        return Obstacles._make(part[: self.now.get("scene.sensed")] for part in self.now.part("scene.near", Obstacles))

    def see(self, now: float, status: RangeStatus = RangeStatus.OK, **distance: float) -> Obstacles:
        """Take new readings of the units that are named."""
        return self.take(readings_of(self.skin, now, status, **distance), now)
