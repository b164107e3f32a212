"""A push against something on the other side that nothing restricts: what the arm does caught between the two."""

from dataclasses import replace
from itertools import product

import mujoco
import numpy as np

from pretouch.control.path import Circle
from pretouch.explanation import resumable
from pretouch.sim.board import PANDA_SIDE
from pretouch.sim.plant import TOUCH_N, Plant
from pretouch.sim.pushes import Holder, Push
from pretouch.sim.scene import Box, HandSpec, SceneSpec
from pretouch.text_table import TextTable, tabulated
from pretouch.traces import mean_over
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.rows import Row, cells_of, peak, rounded
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record, play

NAME = "clamp"
DEFAULT_RESTRICTIONS = "off"
"""Restricted, the arm keeps away from a board it sees: here it is to be caught."""
HELD_S = (0.2, 3.0)
"""How long the push lasts [s]: over when the arm reaches the board, or going on."""

_PUSH_N = 25.0
_START_S = 1.5
_SPEED_M_S = 0.02
"""Speed along the path [m/s]: the arm is about where the board was placed beside it."""
_GAP_M = 0.12
_GAP_SPREAD_M = 0.02
"""The board is so far from the side of the robot's hand, give or take."""
_REACH_S = 1.2
_WATCHED_S = 4.0
_FREE_S = 1.0
"""The end of a trial, in which the arm is to touch the board no more [s]."""
_HALF_M = (0.3, 0.02, 0.2)
_SIDE_M = 0.25
"""Where the path begins, at -y [m]."""


def cells(grid: Grid) -> list[Cell]:
    """A cell for each length of the push and stiffness of the board, of each controller."""
    return [
        Cell(NAME, name, {"held_s": held, "stiffness_n_per_m": stiffness, "restrictions": mode})
        for held, stiffness, (name, mode) in product(HELD_S, grid.stiffness, grid.controllers(DEFAULT_RESTRICTIONS))
    ]


class _Gauge:
    """The force between the arm and the board at each physics step."""

    def __init__(self) -> None:
        self.force: list[float] = []

    def attach(self, plant: Plant, _: object) -> None:
        """Measure before each step."""
        board, wrench = plant.mj_model.geom("object").id, np.zeros(6)

        def measure(_: float) -> None:
            total = 0.0
            for i in range(plant.mj_data.ncon):
                contact = plant.mj_data.contact[i]
                if board in (contact.geom1, contact.geom2):
                    mujoco.mj_contactForce(plant.mj_model, plant.mj_data, i, wrench)
                    total += float(wrench[0])
            self.force.append(total)

        plant.before_each_step(measure)


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    held, gap = float(cell.where["held_s"]), _GAP_M + _GAP_SPREAD_M * np.random.default_rng([seed, 41]).uniform(-1, 1)
    face = -_SIDE_M + PANDA_SIDE.aside + gap
    start = Circle(start_angle=np.pi).point(0.0)
    board = Box(
        "object", (start[0], face + _HALF_M[1], start[2] + PANDA_SIDE.above), _HALF_M,
        float(cell.where["stiffness_n_per_m"]),
    )  # fmt: skip
    person = Holder(context.model, (Push(_START_S, np.array([0.0, -1.0, 0.0]), _PUSH_N, held),))
    found, gauge = context.profile(cell), _Gauge()
    setup = context.setup(
        cell,
        seed,
        SceneSpec(hand=HandSpec(), boxes=(board,)),
        Circle(start_angle=np.pi),
        profile=replace(found, task=replace(found.task, speed_m_s=_SPEED_M_S)),
        hand=person,
        prepare=gauge.attach,
    )
    end = _START_S + _REACH_S + held + _WATCHED_S
    record = play(setup, lambda step, _: step.stamp >= end)
    row = cell.row(seed)
    return row | results(np.array(gauge.force), record), record


def results(force: FloatArray, record: Record) -> Row:
    """Numbers of one trial, given the force (T,) [N] between arm and board at each millisecond."""
    touching = force > TOUCH_N
    last = record.steps[-1]
    return {
        "touched": bool(touching.any()),
        "board_peak_20ms_n": rounded(peak(mean_over(force, 20))),
        "board_mean_n": rounded(float(force[touching].mean())) if touching.any() else None,
        "board_s": rounded(float(touching.sum()) / 1000.0),
        "leaning": bool(touching[-int(_FREE_S * 1000) :].mean() > 0.5),
        "latched": resumable(last),
    }


_MEASURES = ("board_peak_20ms_n", "board_mean_n", "board_s")


def summarise(rows: list[Row]) -> Row:
    """Medians over the seeds of each cell."""
    by = ("held_s", "stiffness_n_per_m", "restrictions", "profile")
    return {"cells": cells_of(rows, by, _MEASURES, totals=("touched", "leaning", "latched"))}


def tables(part: Row) -> list[TextTable]:
    """What was between arm and board."""
    columns = (
        ("held\n[s]", plain("held_s", "g")),
        ("N/mm", lambda cell: f"{cell['stiffness_n_per_m'] / 1000:g}"),
        ("profile", plain("profile")),
        ("touched", share("touched")),
        ("peak\n[N]", median("board_peak_20ms_n", 0)),
        ("mean\n[N]", median("board_mean_n", 0)),
        ("for\n[s]", median("board_s", 2)),
        ("leaning", plain("leaning")),
        ("latched", plain("latched")),
    )
    table = tabulated(
        "Pushed against a board: medians",
        columns,
        part["cells"],
        f"A push of {_PUSH_N:g} N towards a board {_GAP_M:g} m away that restricts nothing. Peak: of the force between"
        " arm and board, 20 ms mean. Mean, for: while they touch. Leaning: trials in which they still touch in the last"
        " second. Latched: trials that end in a HOLD until a person resumes.",
    )
    return [table]


def _cost(cell: Cell) -> float:
    return _START_S + _REACH_S + float(cell.where["held_s"]) + _WATCHED_S


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables)
