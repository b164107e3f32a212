"""Two arms that reach over one table with a person between: blind to each other, seen by the skin alone, or told."""

from itertools import product

import numpy as np

from pretouch.profiles import profile
from pretouch.robot.postures import nearest_points
from pretouch.sim.plant import TOUCH_N
from pretouch.sim.scene import HandSpec
from pretouch.text_table import TextTable, tabulated
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, cells_of, peak, rounded
from pretouch_lab.studies.two_arms_trial import BACK, Played, Side, play
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record

NAME = "two-arms"
DEFAULT_RESTRICTIONS = "slack"
KNOWS = ("blind", "seen", "told")
"""What each arm has of the other: units that see through it; units that take it for anything else; or its reported
state, by which it is a fixture that moves."""
_DURATION_S = 40.0
_APART_S = 0.2
"""A touch that begins sooner after the last one is the same [s]."""
_OF_IT_M = 0.1
"""A sensed point this near to the other arm, and no nearer to the person, shows the arm [m]: offset and noise of the
units, and the beam's width."""


def cells(grid: Grid) -> list[Cell]:
    """Each profile that senses, blind to the other arm, with its skin alone, and told of it."""
    return [
        Cell(NAME, name, {"knows": knows, "restrictions": mode})
        for (name, mode), knows in product(grid.controllers(DEFAULT_RESTRICTIONS), KNOWS)
        if profile(name).perception
    ]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record | None]:
    """Run one trial; return its row of results."""
    own = context.profile(cell)
    played = play(context, own, str(cell.where["knows"]), seed, _DURATION_S)
    asked = own.task.speed_m_s * (_DURATION_S - played.sides[0].steps[0].stamp)
    return cell.row(seed) | results(played, asked), None


def results(played: Played, asked: float) -> Row:
    """Numbers of one trial, in which each arm was asked for a way of so many metres."""
    time, arms, person = (np.array(part) for part in (played.felt.time, played.felt.arms_n, played.felt.person_n))
    done = [side.steps[-1].path_phase / asked for side in played.sides]
    hands = played.hand, _seen_from(BACK, played.hand)
    return {
        "arms": touches(time, arms),
        "arms_peak_n": rounded(peak(arms), 1),
        "person": touches(time, person),
        "person_peak_n": rounded(peak(person), 1),
        "done": rounded(float(np.mean(done)), 4),
        "least_done": rounded(min(done), 4),
        "taken_fraction": rounded(
            float(np.mean([shows_other(side, hand) for side, hand in zip(played.sides, hands, strict=True)])), 4
        ),
        "reactions": sum(step.contact is not None for side in played.sides for step in side.steps),
    }


def touches(time: FloatArray, force: FloatArray) -> int:
    """Count the touches in forces (T,) [N] at instants (T,) [s]."""
    touching = time[force > TOUCH_N]
    return int(len(touching) > 0) + int((np.diff(touching) > _APART_S).sum())


def shows_other(side: Side, hand: FloatArray) -> float:
    """Share of the steps in which a unit shows the other arm as an obstacle; `hand` (S, 3) is the person's [m]."""
    units, found = len(side.controller.skin), 0
    for step, across, at in zip(side.steps, side.across, hand, strict=True):
        point = step.obstacles.point[step.obstacles.unit < units]
        if len(point):
            on_axis, of_point = nearest_points(across.a[None], across.b[None], point[:, None], point[:, None])
            from_arm = (np.linalg.norm(on_axis - of_point, axis=-1) - across.radius).min(axis=1)
            from_hand = np.linalg.norm(point - at, axis=1) - HandSpec.radius
            found += bool(((from_arm < _OF_IT_M) & (from_arm < from_hand)).any())
    return found / len(side.steps)


def _seen_from(T: FloatArray, points: FloatArray) -> FloatArray:
    """Bring points (S, 3) [m] into another frame by its pose T (4, 4)."""
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


_MEASURES = ("arms_peak_n", "person_peak_n", "done", "least_done", "taken_fraction", "reactions")


def summarise(rows: list[Row]) -> Row:
    """Spreads over the seeds of each cell, and how many trials had a touch of the arms, or of the person."""
    flagged = [row | {"arms_touched": row["arms"] > 0, "person_touched": row["person"] > 0} for row in rows]
    totals = ("arms", "person", "arms_touched", "person_touched")
    return {"cells": cells_of(flagged, ("profile", "restrictions", "knows"), _MEASURES, totals=totals)}


def tables(part: Row) -> list[TextTable]:
    """One table: what touched what, and how much of the way was done."""
    columns = (
        ("profile", plain("profile")),
        ("other arm", plain("knows")),
        ("arms\ntouch", share("arms_touched")),
        ("touches", plain("arms")),
        ("peak\n[N]", median("arms_peak_n", 0)),
        ("person\ntouched", share("person_touched")),
        ("touches", plain("person")),
        ("peak\n[N]", median("person_peak_n", 0)),
        ("way\n[%]", median("done", 0, 100)),
        ("slower\n[%]", median("least_done", 0, 100)),
        ("taken\n[%]", median("taken_fraction", 1, 100)),
        ("reactions", median("reactions", 0)),
    )
    return [
        tabulated(
            "Two arms over one table, a person between: medians over the seeds",
            columns,
            part["cells"],
            "Blind: the units see through the other arm. Seen: they take it for anything that comes near. Told: its"
            " reported joint positions make it a fixture that moves. Arms touch, person touched: trials with such a"
            " touch; touches: in all trials together; peak: the largest force of a trial. Way: of what is asked in"
            f" {_DURATION_S:g} s, the mean of both arms, and the slower of them. Taken: share of the steps in which a"
            " unit shows the other arm as an obstacle. Reactions: to contacts, of both arms.",
            names=2,
        )
    ]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: 2 * _DURATION_S, summarise, tables, recorded=False)
