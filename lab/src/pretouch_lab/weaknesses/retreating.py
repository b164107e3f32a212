"""Eq. 3 slows the arm whatever its direction: what that costs on the way back from an object beside the path's end."""

import numpy as np

from pretouch.control.path import WayPoints
from pretouch.sim.scene import Box, SceneSpec
from pretouch.text_table import TextTable, tabulated
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper.static import least_sensed
from pretouch_lab.rows import Row, cells_of, rounded
from pretouch_lab.tables import median, plain
from pretouch_lab.trial import Record, play

NAME = "retreating"
_MODES = ("off", "slack")
_OWN_PROFILE = "slowing-only"
"""Run beside those asked for: the slow-down without what the thresholds do."""

_STIFFNESS_N_PER_M = 25_000.0
_CLEARANCE_M = (0.05, 0.10)
"""Distance of the board from the side of the robot's hand at the end of the line, as the seed has it [m]."""
_HALF_SIZE_M = (0.15, 0.02, 0.12)
_HAND_HALF_WIDTH_M, _HAND_ABOVE_TCP_M = 0.102, 0.057
"""Where the side of the robot's hand is from the end-effector's origin, hand upright [m]."""
_OUTWARDS_M = 0.12
"""The board's centre is this much farther from the base in x than the hand [m], out of the forearm's way."""
_END_M, _BACK_M, _NEAR_M = 1.0, 2.0, 0.3
"""Way to the end by the board, to the beginning again, and the stretch before the board that is compared [m]."""
_CYCLE_M = (0.5, 2.5)
"""Ways between which a cycle is timed: from the middle of the line to there again [m]."""
_TIME_LIMIT_S = 40.0


def cells(grid: Grid) -> list[Cell]:
    """One cell for each controller, the slow-down alone among them; off and slack if the run names no restrictions."""
    profiles = tuple(dict.fromkeys((*grid.profiles, _OWN_PROFILE)))
    modes = Grid(profiles, grid.restrictions or _MODES)
    return [Cell(NAME, profile, {"restrictions": mode}) for profile, mode in modes.controllers("off")]


def path() -> WayPoints:
    """Return the paper's line, to and fro."""
    return WayPoints(np.array([(0.4, 0.5, 0.5), (0.4, -0.5, 0.5)]), closed=True)


def scene(seed: int) -> SceneSpec:
    """Return a board beyond the far end of the line, which the arm comes near but does not reach."""
    rng = np.random.default_rng([seed, 42])
    face = -0.5 - _HAND_HALF_WIDTH_M - rng.uniform(*_CLEARANCE_M)
    center = (0.4 + _OUTWARDS_M, face - _HALF_SIZE_M[1], 0.5 + _HAND_ABOVE_TCP_M)
    return SceneSpec(boxes=(Box("object", center, _HALF_SIZE_M, _STIFFNESS_N_PER_M),))


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    setup = context.setup(cell, seed, scene(seed), path())
    record = play(setup, lambda step, _: step.path_phase >= _CYCLE_M[1] or step.stamp >= _TIME_LIMIT_S)
    return {**cell.row(seed), **results(record)}, record


def results(record: Record) -> Row:
    """Numbers of one trial; None for what the arm did not come to do in the time."""
    phase, times = np.array([s.path_phase for s in record.steps]), record.times()

    def taken(start: float, end: float) -> float | None:
        """Time [s] between two ways [m] along the path, each reached for the first time."""
        if phase[-1] < end:
            return None
        first, last = np.searchsorted(phase, [start, end])
        return float(times[last] - times[first])

    approach, retreat = taken(_END_M - _NEAR_M, _END_M), taken(_END_M, _END_M + _NEAR_M)
    way_back, cycle = taken(_END_M, _BACK_M), taken(*_CYCLE_M)
    return {
        "approach_m_s": None if approach is None else rounded(_NEAR_M / approach, 4),
        "retreat_m_s": None if retreat is None else rounded(_NEAR_M / retreat, 4),
        "way_back_s": None if way_back is None else rounded(way_back),
        "cycle_s": None if cycle is None else rounded(cycle),
        "short_of_end_m": rounded(max(0.0, _END_M - phase[-1]), 4),
        "least_sensed_m": least_sensed(record),
        "contact": record.first_contact() is not None,
        "false_detections": len(record.reactions()),
        "held": record.held(),
    }


_MEASURES = (
    "approach_m_s", "retreat_m_s", "way_back_s", "cycle_s", "short_of_end_m", "least_sensed_m", "lost_s",
    "lost_fraction",
)  # fmt: skip


def summarise(rows: list[Row]) -> Row:
    """Cells of the experiment; what the retreat loses is against `blind` with the same seed."""
    blind = {row["seed"]: row for row in rows if row["profile"] == "blind"}
    compared = [row | _lost(row, blind.get(row["seed"])) for row in rows]
    totals = ("false_detections", "held")
    return {"cells": cells_of(compared, ("profile", "restrictions"), _MEASURES, ("contact",), totals)}


def _lost(row: Row, blind: Row | None) -> Row:
    """Time lost on the way back [s], and its share of the cycle; None where there is nothing to compare."""
    back, cycle = row["way_back_s"], row["cycle_s"]
    free = None if blind is None or row["profile"] == "blind" else blind["way_back_s"]
    if back is None or cycle is None or free is None:
        return {"lost_s": None, "lost_fraction": None}
    return {"lost_s": rounded(back - free), "lost_fraction": rounded((back - free) / cycle, 4)}


def tables(part: Row) -> list[TextTable]:
    """Show speeds before and after the turn, and what the retreat costs."""
    columns = (
        ("profile", plain("profile")),
        ("mode", plain("restrictions")),
        ("to\n[m/s]", median("approach_m_s", 3)),
        ("from\n[m/s]", median("retreat_m_s", 3)),
        ("back\n[s]", median("way_back_s", 2)),
        ("lost\n[s]", median("lost_s", 2)),
        ("cycle\n[s]", median("cycle_s", 2)),
        ("share\n[%]", median("lost_fraction", 0, 100)),
        ("short\n[m]", median("short_of_end_m", 2)),
        ("hit\n[%]", plain("contact_fraction", ".0f", 100)),
    )
    return [
        tabulated(
            "To and fro on the line, a board beyond one end but out of the way: medians",
            columns,
            part["cells"],
            "To and from: mean speed in the last 0.3 m before the end by the board, and in the same 0.3 m on the way"
            " back. Back: time from that end to the other. Lost: that against blind with the same seed. Cycle: there"
            " and back. Share: of the lost time in the cycle. Short: how much is missing to the end after 40 s. A dash:"
            " the arm did not get so far.",
        )
    ]


def _cost(cell: Cell) -> float:
    return 13.0 if cell.where["restrictions"] == "off" else _TIME_LIMIT_S


EXPERIMENT = Experiment(NAME, cells, trial, _cost, summarise, tables)
