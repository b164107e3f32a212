"""Contacts that no unit saw coming, by simulation: a skin, with suggested units, and with units put anywhere.

Balls come at the arm as coverage has them come: straight at random points of its surface, from random directions.
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
"""Units that are added."""
ARMS = {"moving": None, "standing": 0.02}
"""How fast the hand goes [m/s]; None is the profile's own speed."""
COUNT = 24
"""Things that come in a trial."""

_NEAR_M = 0.1
"""A sensed point so near the ball's surface shows the ball [m]."""
_DRIVES_S = 0.016
"""Time from a command to a motion [s]: the drives' set-point filter (`BrakingParams.latency_s`)."""
_POSTURES = 40
_START_S, _EVERY_S = 2.0, 2.5
"""When the first one sets out, and how long after it the next [s]."""
PARKED = (0.0, 0.0, -3.0)
"""Where the ghost is in between: below the floor [m]."""
_BATCH, _BATCHES = 16, 50


@dataclass
class ApproachingObstacle:
    """One that comes: what was foreseen of it, where it was, and how it met the arm."""

    link: int
    center: FloatArray
    """(3,) centre of the ball at the contact, link frame [m]."""
    way: FloatArray
    """(3,) unit vector to where it comes from, link frame."""
    foreseen: bool
    """Whether coverage says that it is seen in time, with the arm standing as it does when it sets out."""
    track: dict[int, tuple[float, FloatArray]] = field(default_factory=dict)
    """Way left [m] and centre (3,) [m] by the number of the physics step."""


class ApproachingObstacles:
    """Moves the ghost of a scene: it follows the link that it comes at, so that they meet whatever the arm does."""

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
            link, center = int(surface.link[drawn[i]]), surface.point[drawn[i]] + r * surface.normal[drawn[i]]
            along = ways.postures[0].rotation[link].T @ ways.way[0, i]
            return ApproachingObstacle(link, center, along, bool(sees.any()))
        raise ExperimentError("Nothing can come at the arm where it stands: make the ways shorter.")


def cells(options: TrialOptions) -> list[Row]:
    """A cell for each skin, with the arm on the circle and almost standing, for each profile that senses."""
    sensing = [name for name in options.profiles if profile(name).perception is not None]
    return [{"arm": arm, "skin": skin, "profile": name} for name, arm, skin in product(sensing, ARMS, SKINS)]


@lru_cache(maxsize=4)
def _places(model: RobotModel, skin: Skin) -> tuple[tuple[SensorUnit, ...], tuple[SensorUnit, ...]]:
    """Return all places for units, and those of them that help most on the circle."""
    ways = CoverageSetting(model, fixtures(SceneSpec()), CoverageParams(), "circle", _POSTURES).ways()
    places = candidates(ways, skin)
    return places, suggest((ways,), skin, MORE, places).units


def skin_of(kind: str, model: RobotModel, skin: Skin, seed: int) -> Skin:
    """Return one of `SKINS`; units put anywhere are others for each seed."""
    if kind == "own":
        return skin
    places, best = _places(model, skin)
    if kind == "suggested":
        return Skin((*skin.mounted, *best), model)
    drawn = np.random.default_rng([seed, 53]).choice(len(places), MORE, replace=False)
    return Skin((*skin.mounted, *(places[i] for i in drawn)), model)


def trial(cell: Row, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return what is measured and what it left behind."""
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
    """Numbers of one trial."""
    points = {round(step.stamp / 0.001): step.obstacles.point for step in record.steps}
    return {
        "came": len(came),
        "blind": sum(not seen_in_time(obstacle, points, params) for obstacle in came),
        "foreseen_blind": sum(not obstacle.foreseen for obstacle in came),
    }


def seen_in_time(obstacle: ApproachingObstacle, points: dict[int, FloatArray], params: CoverageParams) -> bool:
    """Whether the controller had a sensed point on the ball while there was still way left to brake.

    `points` (M, 3) [m] are those of each control step, by its number in milliseconds.
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
    """Show blind contacts by simulation, beside what coverage says."""
    note = (
        "A ball comes straight at random points of the surface. Blind: no sensed point within 0.1 m of it while there"
        " was way left to brake, 95 % bounds below (Clopper and Pearson). Foreseen: what coverage says of the same"
        " ways, the arm standing as when each set out."
    )
    title = f"Contacts that no unit saw in time: the skin, with {MORE} suggested units, with {MORE} anywhere"
    groups = summary(rows, ("arm", "skin", "profile"), (), ("came", "blind", "foreseen_blind"))
    return [table(title, _COLUMNS, [group | _shares(group) for group in groups], note, names=2)]


def _shares(group: Row) -> Row:
    came, blind = group["came"], group["blind"]
    bounds = f"{100 - 100 * share_below(came - blind, came):.0f}-{100 * share_below(blind, came):.0f}"
    return {"blind_share": blind / came, "foreseen_share": group["foreseen_blind"] / came, "bounds": bounds}


EXPERIMENT = Experiment("coverage", cells, trial, tables)
if __name__ == "__main__":
    main(EXPERIMENT.name)
