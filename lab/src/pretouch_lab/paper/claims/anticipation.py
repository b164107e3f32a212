"""How far the thresholds give way to a hand that comes from each direction: eq. 11 against what a skin gives."""

import numpy as np

from pretouch.control.path import line
from pretouch.sim.scene import HandSpec, SceneSpec
from pretouch.types import ControlStep, FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.paper.claims.anticipation_views import DISTANCES_M, PROFILE, summarise, tables
from pretouch_lab.paper.claims.approach import DIRECTIONS, PLACE_M, approach
from pretouch_lab.rows import Row, rounded
from pretouch_lab.trial import Record, play

NAME = "anticipation"

_REST_S = 0.5
"""How long the hand stays at its nearest [s]."""
_COST_S = 10.0
_SEEN_M = 0.05
"""A sensed point up to this far off the hand's surface shows the hand [m]: ranging and pose errors."""


def cells(_grid: Grid) -> list[Cell]:
    """One cell for each direction, always with the paper's parameters and without restrictions."""
    return [Cell(NAME, PROFILE, {"from": direction, "restrictions": "off"}) for direction in DIRECTIONS]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    direction = str(cell.where["from"])
    way = approach(context.model, direction, seed)
    x, y, z = PLACE_M
    start = (float(way.start[0]), float(way.start[1]), float(way.start[2]))
    setup = context.setup(
        cell, seed, SceneSpec(hand=HandSpec(start=start)), line((x, y, z), (x, y + 0.001, z)), hand=way
    )
    record = play(setup, lambda step, _: step.stamp >= way.arrival + _REST_S)
    row = {
        **cell.row(seed),
        **results(record),
    }
    return row, record


def results(record: Record) -> Row:
    """Numbers of one trial: the thresholds at each distance the hand came through, and where it was seen."""
    distance = [
        float(np.linalg.norm(hand - s.ee_position)) for s, hand in zip(record.steps, record.hand_position, strict=True)
    ]
    armed = [i for i, s in enumerate(record.steps) if s.armed]
    sensed = [_sensed(s, hand) for s, hand in zip(record.steps, record.hand_position, strict=True)]
    seen = [distance[i] for i in armed if sensed[i] is not None]

    def at(i: int) -> Row:
        return {"true_m": rounded(distance[i]), "sensed_m": sensed[i], **_bounds(record.steps[i])}

    passed = [next((i for i in armed if distance[i] <= d), None) for d in DISTANCES_M]
    begun = distance[armed[0]]
    return {
        "contact": record.first_contact() is not None,
        "begun_m": rounded(begun),
        "seen": bool(seen),
        "seen_from_m": rounded(max(seen)) if seen else None,
        "at": [None if i is None or begun < d else at(i) for i, d in zip(passed, DISTANCES_M, strict=True)],
        "nearest": at(len(record.steps) - 1),
        "false_detections": len(record.reactions()),
        "held": record.held(),
    }


def _sensed(step: ControlStep, hand: FloatArray) -> float | None:
    """Distance [m] of the nearest point that shows the hand from the end-effector's origin, None if none does."""
    off = np.linalg.norm(step.obstacles.point - hand, axis=1) - HandSpec.radius
    distances = step.obstacles.ee_distance[off < _SEEN_M]
    return rounded(distances.min()) if len(distances) else None


def _bounds(step: ControlStep) -> dict[str, list[float]]:
    """Widths of the band above and below the mean, and by how much objects lower them, x, y, z [N]."""
    limits = step.thresholds
    return {
        "upper_n": [rounded(v) for v in limits.upper - limits.mean],
        "lower_n": [rounded(v) for v in limits.mean - limits.lower],
        "upper_lowered_n": [rounded(v) for v in limits.obstacle_negative],
        "lower_lowered_n": [rounded(v) for v in limits.obstacle_positive],
    }


def _draw(sources: Sources) -> list[Picture]:
    from pretouch_lab.paper.figures.bands import band_figure

    figure = band_figure(sources.summary["cells"])
    return [Picture("anticipation", "Band width against the distance of a hand from six directions", figure)]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: _COST_S, summarise, tables, _draw)
