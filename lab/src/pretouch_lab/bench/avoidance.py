"""Ways to keep clear of people and objects, held against each other in the same scenes: trials, summaries, tables."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch.text_table import TextTable
from pretouch_lab.bench import avoidance_measures as measures
from pretouch_lab.bench.avoidance_scenes import PANDA, Scenario, Setting, place, scenarios, setting
from pretouch_lab.bench.contenders import ABLATED, ABLATED_IN, ABLATED_SEEDS, AVOIDANCE, BASE, WITHOUT, profile_text
from pretouch_lab.bench.obstacle import truth_of
from pretouch_lab.bench.scenes import SeedRange
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, finite, grouped, median_bounds, spread, table
from pretouch_lab.trial import Record, play

_D_MAX_M = 0.8
FORCES = ("peak_estimate_n", "true_peak_20ms_n", "clamping_force_n")
TIMES = ("first_contact_s", "cycle_time_s")
FAMILIES = ("static", "person")
"""Families the goals are about."""
REFERENCES = ("blind", "paper", "paper-off")
SPREAD = (
    "least_distance_m", "true_peak_20ms_n", "true_peak_n", "clamping_force_n", "peak_estimate_n", "impact_speed_m_s",
    "first_contact_s", "tracking_rms_m", "off_path_max_m", "speed_m_s", "jerk_max_rad_s3", "jerk_max_per_second_rad_s3",
    "jerk_rms_rad_s3", "seen_fraction", "held_s",
    "livelock_s",
)  # fmt: skip
"""Measures of which median and 10-90 % over the seeds are given; a trial without one is left out."""
TOTALS = (
    "holds", "livelocks", "reactions", "false_reactions", "towards_person", "solver_failures", "infeasible",
)  # fmt: skip
_NOTE = (
    "Medians over the seeds, 10-90 % below. hit: trials with contact. least: least true distance of the surfaces."
    " impact: closing speed of the point that touches first. estimate: peak of the force estimate along the contact."
    " true: peak of the 20 ms mean of the true force. clamp: largest mean over 0.5 s of unbroken contact. touch: from"
    " the obstacle being within 0.8 m of the end-effector. turn: time of the second turn, > where the trial ended"
    " before."
)
_NAMES = (Column("scenario", "scenario"), Column("contender", "contender"))
_HIT = Column("hit", "contacts", of="trials")
_FORCES = (
    Column("estimate\n[N]", "peak_estimate_n", 1, band=True),
    Column("true\n20 ms", "true_peak_20ms_n", 1, band=True),
    Column("clamp\n[N]", "clamping_force_n", 1, band=True),
    Column("touch\n[s]", "first_contact_s", 2, band=True),
)
_TURN = Column("turn\n[s]", "cycle_time_s", 1, band=True)
_COLUMNS = (
    *_NAMES,
    _HIT,
    Column("least\n[mm]", "least_distance_m", 0, 1000.0, band=True),
    Column("impact\n[m/s]", "impact_speed_m_s", 3, band=True),
    *_FORCES,
    Column("off path\nrms [m]", "tracking_rms_m", 3, band=True),
    Column("along\n[m/s]", "speed_m_s", 3, band=True),
    _TURN,
)
_ABLATED = (
    *_NAMES,
    _HIT,
    *_FORCES,
    _TURN,
    Column("off path\nrms [mm]", "tracking_rms_m", 0, 1000.0, band=True),
    Column("jerk\nrms", "jerk_rms_rad_s3", 0, band=True),
    Column("false", "false_reactions"),
    Column("towards\nperson", "towards_person"),
    Column("holds", "holds"),
    Column("livelocks", "livelocks"),
)


def plays(
    seeds: SeedRange, quick: bool, contenders: Sequence[str] = (), names: Sequence[str] = (), arm: str = PANDA
) -> list[Play]:
    """Return all trials by scenario, contender and seed.

    Args:
        seeds: which range.
        quick: a small part of them.
        contenders: none: all there are, and `pretouch` with each switch off alone in some scenarios.
        names: scenarios; none: all.
        arm: name of the arm, or the folder of an imported one.
    """
    if len(set(contenders)) < len(contenders):
        raise ExperimentError(f"The baselines are {', '.join(contenders)}: name each once.")
    for contender in contenders:
        profile_text(contender)
    if arm != PANDA:
        place(arm)  # what cannot be placed is said before any process starts
    for name in names:
        if name not in scenarios():
            raise ExperimentError(f"The scenario {name!r} is unknown: choose from {', '.join(scenarios())}.")
    scenes = [scene for name, scene in scenarios().items() if not names or name in names]
    whole = [
        ({"scenario": scene.name, "contender": contender}, seed)
        for scene in scenes
        for contender in contenders or AVOIDANCE
        for seed in scene.seeds(seeds, quick)
    ]
    ablated = [
        ({"scenario": scene.name, "contender": contender}, seed)
        for scene in scenes
        if scene.name in ABLATED_IN
        for contender in (() if contenders else ABLATED)
        for seed in scene.seeds(seeds, quick)[:ABLATED_SEEDS]
    ]
    return whole + ablated


def trial(world: str, arm: str, cell: Cell, seed: int) -> Row:
    """Play a trial of a contender, as its seed draws it of a set if one is named."""
    scenario = scenarios()[cell["scenario"]]
    made = setting(scenario, profile(profile_text(cell["contender"])), seed, arm)
    record = play(replace(made.setup, world=world), made.done)
    return {"family": scenario.family, **measured(record, made, scenario)}


def measured(record: Record, made: Setting, scenario: Scenario) -> Row:
    """Return all measures of a trial."""
    setup, params = made.setup, scenario.params
    truth = truth_of(record, setup.model, map(made.shape, record.hand_position))
    held = params["path"]["kind"] == "held"
    return {
        **measures.contact(record, truth, params["obstacle"].get("d_max_m", _D_MAX_M)),
        **measures.tracking(record, setup.path.length, held),
        **measures.smoothness(record, setup.profile.task.control_period_s),
        **measures.holds(record),
        **measures.reactions(record),
        **measures.seen(record, truth, made),
        **measures.livelocks(record, made, params.get("livelock")),
        "timed": "turns" in params,
        "duration_s": round(record.steps[-1].stamp, 3),
    }


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


def paired(rows: list[Row]) -> list[Row]:
    """Return for each baseline and reference the median part of the reference's measure that the baseline has.

    A family's scenarios and seeds count together, with 95 % bounds on the median. A force counts where the reference
    touched; a baseline without contact has none of it. A time counts where either came to an end; what did not is
    infinite, in the result None.
    """
    found = []
    for key, group in grouped([row for row in rows if row["family"] in FAMILIES], ("family", "contender")):
        for reference in REFERENCES:
            pairs = _pairs(rows, group, reference)
            for measure in (*FORCES, *TIMES):
                parts = [part for theirs, mine in pairs if (part := _part(theirs, mine, measure)) is not None]
                if parts and key["contender"] != reference:
                    low, high = median_bounds(parts)
                    middle = np.percentile(parts, 50, method="higher")  # of an infinite value no mean is taken
                    bounds = {"part": finite(middle), "low": finite(low), "high": finite(high)}
                    found.append({**key, "reference": reference, "measure": measure, "trials": len(parts)} | bounds)
    return found


def _pairs(rows: list[Row], group: list[Row], reference: str) -> list[tuple[Row, Row]]:
    of = {(row["scenario"], row["seed"]): row for row in rows if row["contender"] == reference}
    return [(of[where], row) for row in group if (where := (row["scenario"], row["seed"])) in of]


def _part(theirs: Row, mine: Row, measure: str) -> float | None:
    """Return the baseline's measure by the reference's; None where it does not count."""
    if measure in FORCES:
        return (mine[measure] or 0.0) / theirs[measure] if theirs["contact"] and theirs[measure] else None
    if measure == "cycle_time_s" and not mine["timed"]:
        return None
    if mine[measure] is None:
        return None if theirs[measure] is None else np.inf
    return 0.0 if theirs[measure] is None else mine[measure] / theirs[measure] if theirs[measure] else None


def tables(summary: Row) -> list[TextTable]:
    """Return what is lost, each contender in each scenario, a table a family, and ablations."""
    texts = {scene.family: scene.text for scene in scenarios().values()}
    made = [losses(summary["cells"])]
    for key, cells in grouped(summary["cells"], ("family",)):
        family = key["family"]
        made.append(table(f"{family.capitalize()}: contact and cost", _COLUMNS, cells, f"{texts[family]} {_NOTE}", 2))
    note = (
        "On fewer seeds than the tables above: pretouch here has the same. The switches of detection are in the tables"
        " of contact detection."
    )
    by_scene = [cell for _, cells in grouped(summary["ablations"], ("scenario",)) for cell in cells]
    made.append(table("Each switch of pretouch off alone, in the closed loop", _ABLATED, by_scene, note, 2))
    return [each for each in made if each.rows]


_LESS = (
    Column("true 20 ms [N]", "true_peak_20ms_n", 1),
    Column("clamp [N]", "clamping_force_n", 1),
    Column("turn [s]", "cycle_time_s", 1),
    Column("off path rms [mm]", "tracking_rms_m", 0, 1e3),
    Column("jerk rms [rad/s^3]", "jerk_rms_rad_s3", 0),
    Column("held [s]", "held_s", 1),
    Column("livelock [s]", "livelock_s", 1),
)
_MORE = (
    Column("least distance [mm]", "least_distance_m", 0, 1e3),
    Column("along the path [mm/s]", "speed_m_s", 0, 1e3),
)
_NOTICED = 0.05
"""Part of the larger of two values by which they have to differ."""


def losses(cells: list[Row]) -> TextTable:
    """Return each measure of each scenario whose median is better for another contender by more than 5 %."""
    lines = []
    for key, group in grouped(cells, ("scenario",)):
        ours = next((cell for cell in group if cell["contender"] == BASE), None)
        for column in (*_LESS, *_MORE):
            better = _better(group, ours, column.key, -1.0 if column in _MORE else 1.0)
            if ours is None or not better:
                continue
            own = column.text(ours)
            shown = {cell["contender"]: column.text(cell) for cell in better}
            others = ", ".join(f"{contender} {text}" for contender, text in shown.items() if text != own)
            if others:
                lines.append((key["scenario"], column.heading, own, others))
    return TextTable(
        "Where others do better than pretouch",
        ("scenario", "median of", "pretouch", "better"),
        tuple(lines),
        "Every measure of every scenario in which another contender's median is better by more than 5 % and in the"
        " digits shown, whatever it pays for that elsewhere; > is what did not end in its trial.",
    )


def _better(group: list[Row], ours: Row | None, name: str, sign: float) -> list[Row]:
    if ours is None or ours[name] is None:
        return []
    own = _value(ours, name)
    ranked = sorted((cell for cell in group if cell[name] is not None), key=lambda cell: sign * _value(cell, name))
    return [
        cell for cell in ranked
        if sign * (own - _value(cell, name)) > _NOTICED * min(max(abs(own), abs(_value(cell, name))), 1e9)
    ]  # fmt: skip


def _value(cell: Row, name: str) -> float:
    return float("inf") if cell[name]["median"] is None else float(cell[name]["median"])
