"""Simulated contacts that no unit saw in time: with a skin, with suggested units, and with random units added.

Balls approach the arm as in the coverage measure: straight at random points of its surface, from random directions.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import product

import numpy as np

from pretouch.control.path import Circle
from pretouch.coverage.measure import CoverageSetting
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import candidates, suggest
from pretouch.coverage.ways import seen_by, ways_to
from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.plant import Plant
from pretouch.sim.scene import GhostSpec, SceneSpec, fixtures
from pretouch.text_table import TextTable
from pretouch.types import FloatArray
from pretouch_lab.experiment import Context, Experiment, main
from pretouch_lab.options import TrialOptions
from pretouch_lab.replay import Ghost
from pretouch_lab.run import Row
from pretouch_lab.table import Column, share_below, summary, table
from pretouch_lab.trial import Record, play

SKINS = ("own", "suggested", "random")
MORE = 8
"""Number of added units."""
ARMS = {"moving": None, "standing": 0.02}
"""Speed of the hand [m/s]; None: the profile's speed."""
COUNT = 24
"""Number of balls in a trial."""

_NEAR_M = 0.1
"""Largest distance of a sensed point of the ball from its surface [m]."""
_DRIVES_S = 0.016
"""Time from a command to the motion [s]: the drives' set-point filter (`BrakingParams.latency_s`)."""
_POSTURES = 40
_START_S, _EVERY_S = 2.0, 2.5
"""Start of the first ball, and time from one ball to the next [s]."""
PARKED = (0.0, 0.0, -3.0)
"""Place of the ghost between two balls, below the floor (3,) [m]."""
_BATCH, _BATCHES = 16, 50


@dataclass
class ApproachingObstacle:
    """A ball that approaches the arm: its contact point, its track, and the prediction by coverage."""

    link: int
    center: FloatArray
    """(3,) centre of the ball at the contact, link frame [m]."""
    way: FloatArray
    """(3,) unit vector against its motion, link frame."""
    foreseen: bool
    """True if coverage predicts that a unit sees it in time, for the arm's posture at its start."""
    track: dict[int, tuple[float, FloatArray]] = field(default_factory=dict)
    """Remaining distance [m] and centre (3,) [m] by the number of the physics step."""


class ApproachingObstacles:
    """Moves the ghost of a scene: it follows the link of its contact point, so that it meets the arm in any motion."""

    def __init__(self, model: RobotModel, skin: Skin, params: CoverageParams, seed: int) -> None:
        self._model, self._skin, self._params = model, skin, params
        self._rng = np.random.default_rng([seed, 52])
        self.came: list[ApproachingObstacle] = []

    def attach(self, plant: Plant, _: object) -> None:
        """Move the ghost before each physics step."""
        self._plant, self._room = plant, fixtures(plant.scene)
        Ghost(plant, self._place)

    def _place(self, time: float) -> FloatArray:
        number = int((time - _START_S) // _EVERY_S)
        if not 0 <= number < COUNT:
            return np.array(PARKED)
        if number == len(self.came):
            self.came.append(self._drawn())
        obstacle = self.came[number]
        left = self._params.way_m - self._params.closing_m_s * (time - _START_S - number * _EVERY_S)
        R, p = self._plant.link_rotation[obstacle.link], self._plant.link_position[obstacle.link]
        if left <= 0.0:
            return np.array(PARKED)
        center: FloatArray = p + R @ (obstacle.center + left * obstacle.way)
        obstacle.track[round(time / self._plant.params.period_s)] = (left, center)
        return center

    def _drawn(self) -> ApproachingObstacle:
        """Draw a ball with a free way to the arm in its posture."""
        q = self._plant.mj_data.qpos[: self._model.n].copy()
        surface, r = self._model.surface, self._params.object_radius_m
        for _ in range(_BATCHES):
            drawn = self._rng.choice(len(surface.link), _BATCH, p=surface.area / surface.area.sum())
            ways = ways_to(self._model, self._room, self._params, q[None], drawn, self._rng)
            if not ways.free.any():
                continue
            i = int(np.argmax(ways.free[0]))
            sees = seen_by(ways, self._skin)[:, 0, i]
            link, center = int(surface.link[drawn[i]]), surface.point[drawn[i]] + r * surface.normal[drawn[i]]
            along = ways.postures[0].rotation[link].T @ ways.way[0, i]
            return ApproachingObstacle(link, center, along, bool(sees.any()))
        raise ExperimentError("No ball has a free way to the arm in its posture: set a shorter way_m.")


def cells(options: TrialOptions) -> list[Row]:
    """Return a cell for each skin, with the arm on the circle and almost at rest, for each profile with proximity."""
    sensing = [name for name in options.profiles if profile(name).perception is not None]
    return [{"arm": arm, "skin": skin, "profile": name} for name, arm, skin in product(sensing, ARMS, SKINS)]


@lru_cache(maxsize=4)
def _places(model: RobotModel, skin: Skin) -> tuple[tuple[SensorUnit, ...], tuple[SensorUnit, ...]]:
    """Return all places for units, and the suggested ones for the circle."""
    ways = CoverageSetting(model, fixtures(SceneSpec()), CoverageParams(), "circle", _POSTURES).ways()
    places = candidates(ways, skin)
    return places, suggest((ways,), skin, MORE, places).units


def skin_of(kind: str, model: RobotModel, skin: Skin, seed: int) -> Skin:
    """Return one of `SKINS`; the seed draws random units."""
    if kind == "own":
        return skin
    places, best = _places(model, skin)
    if kind == "suggested":
        return Skin((*skin.mounted, *best), model)
    drawn = np.random.default_rng([seed, 53]).choice(len(places), MORE, replace=False)
    return Skin((*skin.mounted, *(places[i] for i in drawn)), model)


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row and its record."""
    model, params = context.model, CoverageParams()
    skin = skin_of(cell["skin"], model, context.skin, seed)
    approaching = ApproachingObstacles(model, skin, params, seed)
    own, speed = context.profile(cell), ARMS[cell["arm"]]
    if speed is not None:
        own = replace(own, task=replace(own.task, speed_m_s=speed))
    setup = context.setup(
        cell,
        seed,
        SceneSpec(ghost=GhostSpec(params.object_radius_m, PARKED)),
        Circle(start_angle=float(np.random.default_rng([seed, 55]).uniform(0, 2 * np.pi))),
        skin=skin,
        profile=own,
        prepare=approaching.attach,
    )
    record = play(setup, lambda step, _: step.stamp >= _START_S + _EVERY_S * COUNT)
    return results(approaching.came, record, params), record


def results(came: list[ApproachingObstacle], record: Record, params: CoverageParams) -> Row:
    """Return the measures of a trial."""
    points = {round(step.stamp / 0.001): step.obstacles.point for step in record.steps}
    return {
        "came": len(came),
        "blind": sum(not seen_in_time(obstacle, points, params) for obstacle in came),
        "foreseen_blind": sum(not obstacle.foreseen for obstacle in came),
    }


def seen_in_time(obstacle: ApproachingObstacle, points: dict[int, FloatArray], params: CoverageParams) -> bool:
    """Return True if the controller had a sensed point on the ball in time to brake.

    `points` are the sensed points (M, 3) [m] of each control step, by its time in milliseconds.
    """
    needed = params.braking_m + _DRIVES_S * params.closing_m_s
    for number, (left, center) in obstacle.track.items():
        sensed = points.get(number)
        if left >= needed and sensed is not None and len(sensed):
            gap = np.linalg.norm(sensed - center, axis=1) - params.object_radius_m
            if gap.min() <= _NEAR_M:
                return True
    return False


_COLUMNS = (
    Column("profile\narm", "profile", second="arm"),
    Column("skin", "skin"),
    Column("blind", "blind", of="came"),
    Column("blind\n[%]", "blind_share", 0, 100.0, second="bounds"),
    Column("foreseen\n[%]", "foreseen_share", 0, 100.0),
)


def tables(rows: list[Row]) -> list[TextTable]:
    """Return a table of blind contacts in simulation, beside the prediction by coverage."""
    note = (
        "Balls move straight at random points of the surface. Blind: balls without a sensed point within 0.1 m in time"
        " to brake, 95 % bounds below (Clopper and Pearson). Foreseen: blind balls by coverage on the same ways, for"
        " the arm's posture at the start of each."
    )
    title = f"Contacts that no unit saw in time: the skin, with {MORE} suggested units, with {MORE} random units"
    groups = summary(rows, ("arm", "skin", "profile"), (), ("came", "blind", "foreseen_blind"))
    return [table(title, _COLUMNS, [group | _shares(group) for group in groups], note, names=2)]


def _shares(group: Row) -> Row:
    came, blind = group["came"], group["blind"]
    bounds = f"{100 - 100 * share_below(came - blind, came):.0f}-{100 * share_below(blind, came):.0f}"
    return {"blind_share": blind / came, "foreseen_share": group["foreseen_blind"] / came, "bounds": bounds}


EXPERIMENT = Experiment("coverage", cells, trial, tables)
if __name__ == "__main__":
    main(EXPERIMENT.name)
