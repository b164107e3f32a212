"""What many trials come to: spreads over seeds, and the benchmark's JSON rows."""

from collections import Counter
from typing import Any

import numpy as np

from pretouch_lab.benchmarks.ablations import BASE, WITHOUT
from pretouch_lab.benchmarks.avoidance.paired import paired
from pretouch_lab.benchmarks.bench import EMPTY, Bench
from pretouch_lab.run import Row
from pretouch_lab.table import grouped, rounded

SPREAD = (
    "least_distance_m", "true_peak_20ms_n", "true_peak_n", "clamping_force_n", "peak_estimate_n", "impact_speed_m_s",
    "first_contact_s", "tracking_rms_m", "off_path_max_m", "speed_m_s", "jerk_max_rad_s3", "jerk_max_per_second_rad_s3",
    "jerk_rms_rad_s3", "manipulability_ee_least", "manipulability_point", "mobility_point_m", "seen_fraction", "held_s",
    "livelock_s",
)  # fmt: skip
"""Measures of which median and 10-90 % over the seeds are given; a trial without one is left out."""
TOTALS = (
    "holds", "livelocks", "reactions", "false_reactions", "towards_person", "solver_failures", "infeasible",
)  # fmt: skip


def summarise(rows: list[Row]) -> Row:
    """Bring trials together.

    Returns:
        `cells`, one for each scenario and baseline; `families`, all scenarios of a family together; `ablations`, cells
        of `pretouch` with each switch off alone and as it is, on the same seeds; `paired`.
    """
    whole = [row for row in rows if not row["contender"].startswith(WITHOUT)]
    return {
        "cells": _cells(whole, ("scenario", "family", "contender")),
        "families": _cells(whole, ("family", "contender")),
        "ablations": _cells(_ablated(rows), ("scenario", "family", "contender")),
        "paired": paired(whole),
    }


def _cells(rows: list[Row], by: tuple[str, ...]) -> list[Row]:
    return [_cell(key, group) for key, group in grouped(rows, by)]


def _ablated(rows: list[Row]) -> list[Row]:
    """Return the trials of ablations, and those of `pretouch` in the same scenarios with the same seeds."""
    off = [row for row in rows if row["contender"].startswith(WITHOUT)]
    played = {(row["scenario"], row["seed"]) for row in off}
    return [row for row in rows if row["contender"] == BASE and (row["scenario"], row["seed"]) in played] + off


def _cell(key: Row, group: list[Row]) -> Row:
    """Summarise the trials of one baseline in one scenario."""
    events: Counter[str] = Counter()
    for row in group:
        events.update(row["hold_events"])
    return {
        **key,
        "trials": len(group),
        "contacts": sum(row["contact"] for row in group),
        **{name: spread([row[name] for row in group]) for name in SPREAD},
        "cycle_time_s": spread([np.inf if row["cycle_time_s"] is None else row["cycle_time_s"] for row in group])
        if group[0]["timed"]
        else None,
        **{name: sum(row[name] or 0 for row in group) for name in TOTALS},
        "hold_events": dict(events),
    }


def spread(values: list[Any]) -> dict[str, float | int | None] | None:
    """Median and 10-90 % of what is not None; None of none. What was not over in time is infinite, and written None."""
    known = [float(v) for v in values if v is not None]
    if not known:
        return None
    # the nearest of the values, where interpolation with an infinite one would make none
    low, middle, high = np.percentile(known, [10, 50, 90], method="nearest" if np.isinf(known).any() else "linear")
    numbers = {"median": middle, "p10": low, "p90": high}
    return {**{k: rounded(v, 4) if np.isfinite(v) else None for k, v in numbers.items()}, "n": len(known)}


_MEDIANS = ("peak_estimate_n", "true_peak_20ms_n", "first_contact_s", "cycle_time_s")
"""Keys all benchmarks share, of which the rows have the median over the seeds."""


def results(summary: Row, bench: Bench) -> Row:
    """Return what the JSON file holds: what was run, a row for each baseline and scenario."""
    kept = {key: summary[key] for key in ("families", "ablations", "paired")}
    return {"about": bench.about(), "rows": json_rows(summary), **kept}


def json_rows(summary: Row) -> list[Row]:
    """Return one row a cell with the keys all benchmarks share, medians over the seeds, then this benchmark's own."""
    return [
        {
            **EMPTY,
            **cell,
            **{name: cell[name]["median"] if cell[name] else None for name in _MEDIANS},
            "spread": {name: cell[name] for name in _MEDIANS},
        }
        for cell in summary["cells"]
    ]
