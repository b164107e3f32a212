"""What the force estimate of an arm is that nothing touches, at several speeds, and what detectors make of it."""

from itertools import product

import numpy as np

from pretouch.control.path import Path, WayPoints
from pretouch.sim.paper_scenes import Placement
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.paper.claims.detectors import (
    TABLE_I,
    Detector,
    Windowed,
    filtered,
    fixed,
    raw,
    raw_twice,
    smooth,
    windowed,
)
from pretouch_lab.paper.claims.free_run import (
    DURATION_S,
    PROFILE,
    Solitude,
    Standing,
    estimate_results,
    estimates,
    false_rates,
    leave_alone,
    tally,
)
from pretouch_lab.paper.claims.free_tables import free_motion_tables
from pretouch_lab.rows import Row, rounded, spread

NAME = "free-motion"
TRAJECTORIES = ("circle", "line")
SPEEDS_M_S = (0.0, 0.1, 0.2, 0.3)
F_BASE_N = (4.0, 6.0, 8.0, 10.0, 12.0)
FIXED_N = (6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 25.0)
QUICK_ALPHA = 0.3
"""Influence of outliers, eq. 8, of a detector that waits less than with Table I's 0.1."""

_RETURN_M_S = 0.1
"""Bound on the speed at which a standing arm goes back to where it is to stand [m/s]."""
_UNMOVED = Placement()
_NORMS = ("norm_median_n", "norm_p95_n", "norm_p99_n")


def cells(_grid: Grid) -> list[Cell]:
    """Both trajectories at each speed; the profile is the experiment's own, for nothing is to react."""
    return [
        Cell(NAME, PROFILE, {"trajectory": trajectory, "speed_m_s": speed})
        for speed, trajectory in product(SPEEDS_M_S, TRAJECTORIES)
    ]


def path(trajectory: str, speed_m_s: float, placement: Placement = _UNMOVED) -> Path:
    """Return the paper's circle, or its line to and fro; at no speed the point where it begins."""
    course = placement.path(trajectory, -1.0)
    if isinstance(course, WayPoints):
        course = WayPoints(course.points, closed=True)
    return course if speed_m_s > 0 else Standing(course.point(0.0))


def trial(cell: Cell, seed: int, context: Context, duration_s: float = DURATION_S) -> tuple[Row, None]:
    """Run one trial; return its row of results. Its course is of no use to a figure."""
    trajectory, speed_m_s = str(cell.where["trajectory"]), float(cell.where["speed_m_s"])
    way = path(trajectory, speed_m_s, context.placement)
    what = Solitude(way, speed_m_s or _RETURN_M_S, context.arm, duration_s)
    record = leave_alone(what, cell, seed, context)
    off = np.array([s.ee_position - s.path_position for s in record.steps if s.armed])
    force = estimates(record)
    row = {
        **cell.row(seed),
        **estimate_results(windowed(force)),
        "path_rms_m": rounded(float(np.sqrt((off**2).sum(axis=1).mean())), 5),
        "detections": detections(force),
    }
    return row, None


def detections(force: FloatArray) -> list[Row]:
    """Count what each detector takes for a contact in the course (S, 3) [N] of an arm that nothing touches."""
    course, quick = windowed(force), smooth(force, QUICK_ALPHA)
    forms: dict[str, tuple[Detector, Windowed]] = {
        "filtered": (filtered, course),
        "alpha 0.3": (filtered, quick),
        "raw": (raw, course),
        "raw twice": (raw_twice, course),
    }
    moving = [
        tally(name, detector(seen, f_base, f_obs), f_base, f_obs > 0)
        for name, (detector, seen) in forms.items()
        for f_obs, f_base in product((0.0, TABLE_I.f_d_n), F_BASE_N)
        if f_base > f_obs
    ]
    return moving + [tally("fixed", fixed(course, force_n), force_n, False) for force_n in FIXED_N]


def summary(rows: list[Row]) -> Row:
    """Cells by speed and false detections of all that moved: of both trajectories together, and of each."""
    trajectories = [name for name in TRAJECTORIES if any(row["trajectory"] == name for row in rows)]
    return _part(rows) | {
        "by_trajectory": [
            {"trajectory": name, **_part([row for row in rows if row["trajectory"] == name])} for name in trajectories
        ]
    }


def _part(rows: list[Row]) -> Row:
    speeds = sorted({row["speed_m_s"] for row in rows})
    fastest = {_twin(row): row for row in rows if row["speed_m_s"] == speeds[-1]}
    return {
        "cells": [_cell(speed, [row for row in rows if row["speed_m_s"] == speed], fastest) for speed in speeds],
        "false_detections": false_rates([row for row in rows if row["speed_m_s"] > 0]),
    }


def _cell(speed_m_s: float, group: list[Row], fastest: dict[tuple[str, int], Row]) -> Row:
    """Summarise the trials at one speed; `narrower_n` is what F_sigma lost from the fastest, arm by arm."""
    pairs = [(fastest[_twin(row)], row) for row in group if _twin(row) in fastest]
    offset = np.array([row["offset_n"] for row in group])
    return {
        "speed_m_s": speed_m_s,
        "trials": len(group),
        "hours": rounded(sum(row["hours"] for row in group), 4),
        "offset_n": [rounded(value) for value in np.abs(offset).mean(axis=0)],
        "std_n": _by_axis([row["std_n"] for row in group]),
        "largest_deviation_n": [rounded(max(row["largest_deviation_n"][axis] for row in group)) for axis in range(3)],
        **{norm: spread([row[norm] for row in group]) for norm in _NORMS},
        "norm_max_n": max(row["norm_max_n"] for row in group),
        "path_rms_m": spread([row["path_rms_m"] for row in group]),
        "f_sigma_n": _by_axis([row["f_sigma_n"] for row in group]),
        "narrower_n": _by_axis([np.subtract(fast["f_sigma_n"], row["f_sigma_n"]).tolist() for fast, row in pairs]),
        "band_n": _by_axis([row["band_n"] for row in group]),
    }


def _twin(row: Row) -> tuple[str, int]:
    return row["trajectory"], row["seed"]


def _by_axis(values: list[list[float]]) -> list[Row | None]:
    return [spread([value[axis] for value in values]) for axis in range(3)]


def _draw(sources: Sources) -> list[Picture]:
    from pretouch_lab.paper.claims.free_figures import free_motion_figure

    figure = free_motion_figure(sources.summary)
    return [Picture("free-motion", "Thresholds against speed, and false detections against the base force", figure)]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: DURATION_S, summary, free_motion_tables, _draw, recorded=False)
