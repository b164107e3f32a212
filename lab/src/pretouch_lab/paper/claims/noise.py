"""How many false detections there are, the noisier the arm's sensors are."""

from dataclasses import replace

import numpy as np

from pretouch.control.path import Circle
from pretouch.sim.plant_params import Joints, PlantParams
from pretouch.types import FloatArray
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.paper.claims.detectors import TABLE_I, filtered, fixed, raw, steady, windowed
from pretouch_lab.paper.claims.free_run import (
    DURATION_S,
    PROFILE,
    Solitude,
    estimate_results,
    estimates,
    false_rates,
    leave_alone,
    tally,
)
from pretouch_lab.paper.claims.free_tables import noise_tables
from pretouch_lab.rows import Row, rounded, spread

NAME = "noise"
FACTORS = (1.0, 2.0, 3.0, 4.0, 6.0)
FIXED_N = (10.0, 20.0)


def cells(_grid: Grid) -> list[Cell]:
    """A cell for each noise factor; the profile is the experiment's own, for nothing is to react."""
    return [Cell(NAME, PROFILE, {"noise_factor": factor}) for factor in FACTORS]


def noisy(factor: float) -> PlantParams:
    """Return the usual arm with its sensors' noise and ripple times a factor; friction and offsets stay."""
    usual = PlantParams()

    def times(values: Joints) -> Joints:
        return tuple(factor * value for value in values)

    return replace(
        usual,
        torque_noise_nm=times(usual.torque_noise_nm),
        ripple_nm=times(usual.ripple_nm),
        velocity_noise_rad_s=factor * usual.velocity_noise_rad_s,
    )


def trial(cell: Cell, seed: int, context: Context, duration_s: float = DURATION_S) -> tuple[Row, None]:
    """Run one trial on the circle; return its row of results. Its course is of no use to a figure."""
    what = Solitude(Circle(), plant=noisy(float(cell.where["noise_factor"])), duration_s=duration_s)
    force = estimates(leave_alone(what, cell, seed, context))
    row = {
        **cell.row(seed),
        **estimate_results(windowed(force)),
        "detections": detections(force),
    }
    return row, None


def detections(force: FloatArray) -> list[Row]:
    """Count what each detector takes for a contact in the course (S, 3) [N] of an arm that nothing touches."""
    course, f_base, f_d = windowed(force), TABLE_I.f_base_n, TABLE_I.f_d_n
    return [
        tally("filtered", filtered(course, f_base), f_base, False),
        tally("filtered", filtered(course, f_base, f_d), f_base, True),
        tally("no F_sigma", steady(course, f_base), f_base, False),
        tally("no F_sigma", steady(course, f_base, f_d), f_base, True),
        tally("raw", raw(course, f_base), f_base, False),
        *(tally("fixed", fixed(course, force_n), force_n, False) for force_n in FIXED_N),
    ]


def summary(rows: list[Row]) -> Row:
    """Cells by noise factor, each with its false detections."""
    factors = sorted({row["noise_factor"] for row in rows})
    return {"cells": [_cell(factor, [row for row in rows if row["noise_factor"] == factor]) for factor in factors]}


def _cell(factor: float, group: list[Row]) -> Row:
    capped = np.array([row["f_sigma_capped"] for row in group]).mean(axis=0)
    return {
        "noise_factor": factor,
        "trials": len(group),
        "hours": rounded(sum(row["hours"] for row in group), 4),
        **{key: [spread([row[key][axis] for row in group]) for axis in range(3)] for key in ("std_n", "f_sigma_n")},
        "f_sigma_capped": [rounded(value, 4) for value in capped],
        "false_detections": false_rates(group),
    }


def _draw(sources: Sources) -> list[Picture]:
    from pretouch_lab.paper.claims.free_figures import noise_figure

    figure = noise_figure(sources.summary)
    return [Picture("noise", "F_sigma and false detections against the noise of the arm's sensors", figure)]


EXPERIMENT = Experiment(NAME, cells, trial, lambda _: DURATION_S, summary, noise_tables, _draw, recorded=False)
