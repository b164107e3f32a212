"""Things that come at a simulated arm as coverage has them come: straight at random points, from random directions."""

from dataclasses import dataclass, field

import numpy as np

from pretouch.coverage.params import CoverageParams
from pretouch.coverage.ways import seen_by, ways_to
from pretouch.errors import ExperimentError
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sim.plant import Plant
from pretouch.sim.scene import fixtures
from pretouch.types import FloatArray
from pretouch_lab.ghost import Ghost

START_S, EVERY_S = 2.0, 2.5
"""When the first one sets out, and how long after it the next [s]."""
PARKED = np.array([0.0, 0.0, -3.0])
"""Where the ghost is in between: below the floor [m]."""
_BATCH, _BATCHES = 16, 50


@dataclass
class ApproachingObstacle:
    """One that comes: what was foreseen of it, where it was, and how it met the arm."""

    link: int
    center: FloatArray
    """(3,) centre of the ball at the contact, link frame [m]."""
    normal: FloatArray
    """(3,) of the surface there, link frame."""
    way: FloatArray
    """(3,) unit vector to where it comes from, link frame."""
    foreseen: bool
    """Whether coverage says that it is seen in time, with the arm standing as it does when it sets out."""
    track: dict[int, tuple[float, FloatArray]] = field(default_factory=dict)
    """Way left [m] and centre (3,) [m] by the number of the physics step."""
    touch_m_s: float | None = None
    """Speed of the arm's surface towards it when they meet [m/s]; None if the trial ended before."""


class ApproachingObstacles:
    """Moves the ghost of a scene: it follows the link that it comes at, so that they meet whatever the arm does."""

    def __init__(self, model: RobotModel, skin: Skin, params: CoverageParams, count: int, seed: int) -> None:
        self._model, self._skin, self._params = model, skin, params
        self._rng = np.random.default_rng([seed, 52])
        self.came: list[ApproachingObstacle] = []
        self.end = START_S + EVERY_S * count
        """When the last one has come [s]."""
        self._count = count

    def attach(self, plant: Plant, _: object) -> None:
        """Move the ghost before each physics step."""
        self._plant, self._room = plant, fixtures(plant.scene)
        Ghost(plant, self._place)

    def _place(self, time: float) -> FloatArray:
        number = int((time - START_S) // EVERY_S)
        if not 0 <= number < self._count:
            return PARKED
        if number == len(self.came):
            self.came.append(self._drawn())
        obstacle = self.came[number]
        left = self._params.way_m - self._params.closing_m_s * (time - START_S - number * EVERY_S)
        R, p = self._plant.link_rotation[obstacle.link], self._plant.link_position[obstacle.link]
        if left <= 0.0:
            if obstacle.touch_m_s is None:
                obstacle.touch_m_s = self._speed(obstacle, np.array(R), np.array(p))
            return PARKED
        center: FloatArray = p + R @ (obstacle.center + left * obstacle.way)
        obstacle.track[round(time / self._plant.params.period_s)] = (left, center)
        return center

    def _drawn(self) -> ApproachingObstacle:
        """Draw a free way to the arm as it stands."""
        q = self._plant.mj_data.qpos[: self._model.n].copy()
        surface, r = self._model.surface, self._params.object_radius_m
        for _ in range(_BATCHES):
            drawn = self._rng.choice(len(surface.link), _BATCH, p=surface.area / surface.area.sum())
            ways = ways_to(self._model, self._room, self._params, q[None], drawn, self._rng)
            if not ways.free.any():
                continue
            i = int(np.argmax(ways.free[0]))
            sees = seen_by(ways, self._skin)[:, 0, i]
            link, point, normal = int(surface.link[drawn[i]]), surface.point[drawn[i]], surface.normal[drawn[i]]
            along = ways.postures[0].rotation[link].T @ ways.way[0, i]
            return ApproachingObstacle(link, point + r * normal, normal, along, bool(sees.any()))
        raise ExperimentError("Nothing can come at the arm where it stands: make the ways shorter.")

    def _speed(self, obstacle: ApproachingObstacle, R: FloatArray, p: FloatArray) -> float:
        """Speed [m/s] of the arm's surface towards the ball where they meet."""
        data, n = self._plant.mj_data, self._model.n
        kin = self._model.kinematics(data.qpos[:n].copy())
        at = p + R @ (obstacle.center - self._params.object_radius_m * obstacle.normal)
        velocity = self._model.jacobian(kin, obstacle.link, at)[:3] @ data.qvel[:n]
        return float(velocity @ (R @ obstacle.normal))
