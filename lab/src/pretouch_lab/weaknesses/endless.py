"""A static object on the path that nobody takes away: the arm touches it, gives way, comes back, for a minute."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from pretouch.sim.paper_scenes import static_path, static_scene
from pretouch.sim.plant import TOUCH_N
from pretouch.text_table import TextTable, tabulated
from pretouch.traces import mean_over
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment
from pretouch_lab.paper import static
from pretouch_lab.rows import Row, cells_of, peak, rounded
from pretouch_lab.tables import median, plain, share
from pretouch_lab.trial import Record, play

NAME = "endless"

_DURATION_S = 60.0
_APART_S = 0.2
"""Touches with less time than this between them are one contact [s]."""
_QUIET_S = 10.0
"""Without a contact for this long at the end, the arm has ended it by itself [s]."""
_KEYS = ("trajectory", "side", "stiffness_n_per_m", "restrictions", "profile")


def cells(grid: Grid) -> list[Cell]:
    """The cells of the static experiment."""
    return [replace(cell, experiment=NAME) for cell in static.cells(grid)]


def trial(cell: Cell, seed: int, context: Context) -> tuple[Row, Record]:
    """Run one trial; return its row of results and what it left behind."""
    trajectory, side = str(cell.where["trajectory"]), str(cell.where["side"])
    setup = context.setup(
        cell,
        seed,
        static_scene(trajectory, side, float(cell.where["stiffness_n_per_m"]), seed),
        static_path(trajectory, side),
    )
    record = play(setup, lambda step, _: step.stamp >= _DURATION_S)
    row = {**cell.row(seed), **results(record)}
    return row, record


def results(record: Record) -> Row:
    """Numbers of one trial; peaks are those of the true force's mean over 20 ms."""
    force = np.linalg.norm(record.true_force, axis=1)
    found = contacts(record.true_time, force)
    detected = [s.stamp for s in record.reactions()]
    peaks = [peak(mean_over(force[first : last + 1], 20)) for first, last in found]
    end = float(record.true_time[-1])
    return {
        "contacts": len(found),
        "detections": len(detected),
        "interval_s": rounded(float(np.median(np.diff(detected))), 3) if len(detected) > 1 else None,
        "first_peak_n": rounded(peaks[0]) if peaks else None,
        "last_peak_n": rounded(peaks[-1]) if peaks else None,
        "highest_peak_n": rounded(max(peaks)) if peaks else None,
        "touching_fraction": rounded(float((force > TOUCH_N).mean()), 4),
        "ended": end - float(record.true_time[found[-1][1]]) > _QUIET_S if found else False,
        "held": record.held(),
    }


def contacts(time: FloatArray, force: FloatArray) -> list[tuple[int, int]]:
    """First and last index of each contact, given the size of the true force (T,) [N] at instants (T,) [s]."""
    touching = np.flatnonzero(force > TOUCH_N)
    if len(touching) == 0:
        return []
    new = np.flatnonzero(np.diff(time[touching]) >= _APART_S) + 1
    edges = [0, *new.tolist(), len(touching)]
    return [(int(touching[a]), int(touching[b - 1])) for a, b in pairwise(edges)]


_MEASURES = (
    "contacts", "detections", "interval_s", "first_peak_n", "last_peak_n", "highest_peak_n", "touching_fraction",
)  # fmt: skip


def summarise(rows: list[Row]) -> Row:
    """Medians over the seeds of each cell."""
    return {"cells": cells_of(rows, _KEYS, _MEASURES, totals=("ended", "held"))}


def tables(part: Row) -> list[TextTable]:
    """How often the arm touched one and the same object."""
    columns = (
        ("where", lambda cell: f"{cell['trajectory']} {cell['side']}"),
        ("profile", plain("profile")),
        ("mode", plain("restrictions")),
        ("N/mm", lambda cell: f"{cell['stiffness_n_per_m'] / 1000:g}"),
        ("con-\ntacts", median("contacts", 0)),
        ("detec-\ntions", median("detections", 0)),
        ("every\n[s]", median("interval_s", 2)),
        ("first\n[N]", median("first_peak_n", 1)),
        ("last\n[N]", median("last_peak_n", 1)),
        ("touch\n[%]", median("touching_fraction", 0, 100)),
        ("ended", share("ended")),
    )
    table = tabulated(
        f"A static object stays on the path for {_DURATION_S:g} s: medians",
        columns,
        part["cells"],
        f"Mode: of the restrictions. Contacts: touches at least {_APART_S:g} s apart. Every: time between detections."
        " First, last: peak of the true force, 20 ms mean, in the first and the last contact. Touch: share of the time"
        f" in contact. Ended: trials without a contact in the last {_QUIET_S:g} s.",
    )
    return [table]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: _DURATION_S, summarise, tables)
