"""Paper IV-B: a person holds a hand beside the circle or into it, on one side and then on the other."""

from itertools import product

import numpy as np

from pretouch.perception.closest import closest_points
from pretouch.profiles import profile
from pretouch.robot.model import RobotModel
from pretouch.sim.paper_scenes import Placement
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.rows import Row, rounded
from pretouch_lab.summary import avoidance_summary
from pretouch_lab.tables import avoidance_tables
from pretouch_lab.trial import Record, play
from pretouch_lab.visits import Visit, Visitor

NAME = "avoidance"
DEFAULT_RESTRICTIONS = "slack"

_DURATION_S = 40.0
_VISITS_S = ((4.0, 14.0), (20.0, 30.0))
PLACES = ("beside", "inside")
"""Where the person's hand is: 3 cm clear of the robot's on the free circle, or half of it in its way."""
_SPREAD_M = 0.03
_UNMOVED = Placement()


def cells(grid: Grid) -> list[Cell]:
    """A cell for each place of the hand and each controller."""
    return [
        Cell(NAME, profile, {"place": place, "restrictions": restrictions})
        for place, (profile, restrictions) in product(PLACES, grid.controllers(DEFAULT_RESTRICTIONS))
    ]


def visits(place: str, seed: int, placement: Placement = _UNMOVED) -> tuple[Visit, ...]:
    """One visit on each side of the circle, at a place that the seed varies by a few centimetres."""
    rng = np.random.default_rng([seed, 12])
    return tuple(
        Visit(arrive, leave, np.array(placement.visited(place, side)) + _SPREAD_M * rng.uniform(-1, 1, 3))
        for (arrive, leave), side in zip(_VISITS_S, (-1.0, 1.0), strict=True)
    )


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    where = context.placement
    person = Visitor(context.model, visits(str(cell.where["place"]), seed, where))
    setup = context.setup(cell, seed, SceneSpec(hand=HandSpec()), where.path("circle", -1.0), hand=person)
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    steps = record.steps
    off = [float(np.linalg.norm(s.ee_position - s.path_position)) for s in steps]
    row = {
        **cell.row(seed),
        "contact": record.first_contact() is not None,
        "true_peak_n": rounded(float(np.linalg.norm(record.true_force, axis=1).max())),
        "least_gap_m": rounded(float(gaps(record, context.model, HandSpec.radius).min()), 4),
        "deviation_m": rounded(max(off), 4),
        "least_speed_scale": rounded(min(s.speed_scale for s in steps)),
        "largest_slack_m_s": rounded(max(float(s.qp.slack.max(initial=0.0)) for s in steps), 4),
        "travelled_m": rounded(steps[-1].path_phase),
        "false_detections": sum(
            record.first_contact(after=s.stamp - 0.5) is None
            or (record.first_contact(after=s.stamp - 0.5) or 0.0) > s.stamp
            for s in record.reactions()
        ),
        "held": record.held(),
    }
    return row, record


def gaps(record: Record, model: RobotModel, radius: float) -> FloatArray:
    """Distance (S,) [m] between the person's hand, a ball of a radius [m], and the arm at each control step."""
    unit, aside, found = np.zeros(1, np.int64), np.array([[0.0, 0.0, 1.0]]), []
    for step, hand in zip(record.steps, record.hand_position, strict=True):
        kin = model.kinematics(step.q)
        nearest = closest_points(kin, model.body, step.ee_position, unit, hand[None], aside)
        found.append(float(nearest.body_distance[0]) - radius)
    return np.array(found)


def _draw(sources: Sources) -> list[Picture]:
    from pretouch_lab.paper.figures.circle import circle_figure

    for cell in sources.summary["cells"]:
        if cell["place"] == "beside" and cell["profile"] != "blind":
            where = {key: cell[key] for key in ("place", "restrictions")}
            trace = sources.trace(Cell(NAME, cell["profile"], where))
            if trace is not None:
                figure = circle_figure(trace, profile(cell["profile"]))
                return [Picture("avoidance", "End-effector path with a hand beside it", figure)]
    return []


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: _DURATION_S, avoidance_summary, avoidance_tables, _draw)
