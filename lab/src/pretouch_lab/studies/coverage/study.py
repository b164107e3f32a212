"""Contacts that no unit saw coming, by simulation: a skin, with suggested units, and with units put anywhere."""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np

from pretouch.control.path import Circle
from pretouch.coverage.measure import Setting, covered
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.suggest import candidates, suggest
from pretouch.coverage.ways import Ways, seen_by
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from pretouch.sensing.unit import SensorUnit
from pretouch.sim.scene import GhostSpec, SceneSpec, fixtures
from pretouch.text_table import TextTable, tabulated
from pretouch.types import FloatArray
from pretouch_lab.benchmarks.bounds import share_below
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, grouped, rounded
from pretouch_lab.studies.coverage.approaching import (
    EVERY_S,
    PARKED,
    START_S,
    ApproachingObstacle,
    ApproachingObstacles,
)
from pretouch_lab.tables import plain
from pretouch_lab.trial import Record, play

NAME = "coverage"
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
_FAST_M_S = 0.1
"""Speed of the arm towards what it meets that is counted as fast [m/s]."""
_POSTURES = 40


def cells(grid: Grid) -> list[Cell]:
    """A cell for each skin, with the arm on the circle and almost standing, for each profile that senses."""
    sensing = [name for name in grid.profiles if profile(name).perception is not None]
    return [Cell(NAME, name, {"arm": arm, "skin": skin}) for name, arm, skin in product(sensing, ARMS, SKINS)]


@lru_cache(maxsize=4)
def _prepared(model: RobotModel, skin: Skin) -> tuple[Ways, tuple[SensorUnit, ...], tuple[SensorUnit, ...]]:
    """Return fresh ways on the circle, all places for units, and the best of them, chosen by other ways."""
    setting = Setting(model, fixtures(SceneSpec()), CoverageParams(), "circle", _POSTURES)
    ways = setting.ways()
    places = candidates(ways, skin)
    return setting.ways(1), places, suggest((ways,), skin, MORE, places).units


def skin_of(kind: str, model: RobotModel, skin: Skin, seed: int) -> Skin:
    """Return one of `SKINS`; units put anywhere are others for each seed."""
    if kind == "own":
        return skin
    _, places, best = _prepared(model, skin)
    if kind == "suggested":
        return Skin((*skin.mounted, *best), model)
    drawn = np.random.default_rng([seed, 53]).choice(len(places), MORE, replace=False)
    return Skin((*skin.mounted, *(places[i] for i in drawn)), model)


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    model, params = context.model, CoverageParams()
    skin = skin_of(str(cell.where["skin"]), model, context.skin, seed)
    approaching = ApproachingObstacles(model, skin, params, COUNT, seed)
    found, speed = context.profile(cell), ARMS[str(cell.where["arm"])]
    if speed is not None:
        found = replace(found, task=replace(found.task, speed_m_s=speed))
    parked = (float(PARKED[0]), float(PARKED[1]), float(PARKED[2]))
    setup = context.setup(
        cell,
        seed,
        SceneSpec(ghost=GhostSpec(params.object_radius_m, parked)),
        Circle(start_angle=float(np.random.default_rng([seed, 55]).uniform(0, 2 * np.pi))),
        skin=skin,
        profile=found,
        prepare=approaching.attach,
    )
    record = play(setup, lambda step, _: step.stamp >= approaching.end)
    row = cell.row(seed)
    return row | results(approaching.came, record, params) | {
        "predicted": _predicted(model, context.skin, skin)
    }, record


def _predicted(model: RobotModel, own: Skin, skin: Skin) -> float | None:
    """Share of the ways, over the whole circle, that coverage says are not seen in time."""
    ways = _prepared(model, own)[0]
    seen = seen_by(ways, skin)
    return rounded(1.0 - covered(ways, seen).arm.ways)


def results(came: list[ApproachingObstacle], record: Record, params: CoverageParams) -> Row:
    """Numbers of one trial."""
    points = {round(step.stamp / 0.001): step.obstacles.point for step in record.steps}
    blind = [not seen_in_time(obstacle, points, params) for obstacle in came]
    towards = [obstacle.touch_m_s for obstacle in came if obstacle.touch_m_s is not None]
    foreseen = [obstacle.foreseen for obstacle in came]
    return {
        "came": len(came),
        "blind": sum(blind),
        "foreseen_blind": len(came) - sum(foreseen),
        "agree": sum(b != f for b, f in zip(blind, foreseen, strict=True)),
        "fast": sum(v > _FAST_M_S for v in towards),
        "towards_m_s": rounded(float(np.mean(np.maximum(towards, 0.0)))) if towards else None,
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


def summarise(rows: list[Row]) -> Row:
    """Counts of each cell over its seeds, with bounds on the share of blind contacts (Clopper and Pearson, 95 %)."""
    made = []
    for key, group in grouped(rows, ("arm", "skin", "profile")):
        total = {name: sum(row[name] for row in group) for name in ("came", "blind", "foreseen_blind", "agree", "fast")}
        came, blind = total["came"], total["blind"]
        towards = [row["towards_m_s"] for row in group if row["towards_m_s"] is not None]
        made.append({
            **key, "trials": len(group), **total,
            "blind_low": rounded(1.0 - share_below(came - blind, came)),
            "blind_high": rounded(share_below(blind, came)),
            "predicted": rounded(float(np.mean([row["predicted"] for row in group]))),
            "towards_m_s": rounded(float(np.mean(towards))) if towards else None,
        })  # fmt: skip
    return {"cells": made}


def tables(part: Row) -> list[TextTable]:
    """Blind contacts by simulation, beside what coverage says."""

    def share(name: str) -> Callable[[Row], str]:
        return lambda cell: f"{100 * cell[name] / cell['came']:.0f}"

    columns = (
        ("profile\narm", lambda cell: f"{cell['profile']}\n{cell['arm']}"),
        ("skin", plain("skin")),
        ("blind", lambda cell: f"{cell['blind']}/{cell['came']}"),
        (
            "blind\n[%]",
            lambda c: f"{100 * c['blind'] / c['came']:.0f}\n{100 * c['blind_low']:.0f}-{100 * c['blind_high']:.0f}",
        ),
        ("foreseen\n[%]", share("foreseen_blind")),
        ("circle\n[%]", plain("predicted", ".0f", 100)),
        ("agree\n[%]", share("agree")),
        ("fast\n[%]", share("fast")),
        ("towards\n[mm/s]", lambda c: "-" if c["towards_m_s"] is None else f"{1000 * c['towards_m_s']:.0f}"),
    )
    table = tabulated(
        f"Contacts that no unit saw in time: the skin, with {MORE} suggested units, with {MORE} anywhere",
        columns,
        part["cells"],
        "A ball comes straight at random points of the surface. Blind: no sensed point within 0.1 m of it while there"
        " was way left to brake, 95 % bounds below. Foreseen: what coverage says of the same ways, the arm standing as"
        " when each set out; agree: cases in which both say the same. Circle: what it says of the whole circle. Fast:"
        f" the arm's surface goes towards the ball at more than {_FAST_M_S:g} m/s when they meet. Towards: the mean of"
        " that, 0 where it goes away.",
    )
    return [table]


def _cost(_: Cell) -> float:
    return START_S + EVERY_S * COUNT


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables, recorded=False)
