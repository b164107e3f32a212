"""Controllers that avoid people and objects, compared in the same scenes: trials, summaries, tables."""

from collections.abc import Sequence
from dataclasses import replace
from math import inf

from pretouch.errors import ExperimentError
from pretouch.profiles import profile
from pretouch.text_table import TextTable
from pretouch_lab.bench.avoidance_measures import measured
from pretouch_lab.bench.avoidance_scenes import scenarios, setting
from pretouch_lab.bench.contenders import ABLATED, ABLATED_IN, ABLATED_SEEDS, AVOIDANCE, BASE, WITHOUT, profile_text
from pretouch_lab.bench.scenes import SeedRange
from pretouch_lab.run import Cell, Play, Row
from pretouch_lab.table import Column, grouped, summary, table
from pretouch_lab.trial import play

_TOTALS = ("contact", "holds", "livelocks", "reactions", "false_reactions", "towards_person")
_NOTE = (
    "Medians over the seeds, 10-90 % below. hit: trials with contact. least: least true distance of the surfaces."
    " impact: closing speed of the point that touches first. estimate: peak of the force estimate along the contact."
    " true: peak of the 20 ms mean of the true force. clamp: largest mean over 0.5 s of unbroken contact. touch: time"
    " of the first contact after the obstacle came within 0.8 m of the end-effector. turn: time of the second turn; >"
    " if the trial ended before."
)
_NAMES = (Column("scenario", "scenario"), Column("contender", "contender"))
_HIT = Column("hit", "contact", of="trials")
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
"""Least difference that counts, as a fraction of the larger value."""
_SPREAD = tuple({column.key: 0 for column in (*_COLUMNS, *_ABLATED, *_LESS, *_MORE) if column.digits is not None})
"""Measures whose median and 10-90 % over the seeds the tables show; trials without a value are left out."""


def plays(seeds: SeedRange, quick: bool, contenders: Sequence[str] = (), names: Sequence[str] = ()) -> list[Play]:
    """Return all trials by scenario, contender and seed.

    Args:
        seeds: range of seeds.
        quick: play a small part of the trials.
        contenders: empty: all, and in some scenarios `pretouch` with one switch off at a time.
        names: of scenarios; empty: all.
    """
    if len(set(contenders)) < len(contenders):
        raise ExperimentError(f"The baselines are {', '.join(contenders)}: name each once.")
    for contender in contenders:
        profile_text(contender)
    if unknown := [name for name in names if name not in scenarios()]:
        raise ExperimentError(f"The scenario {unknown[0]!r} is unknown: choose from {', '.join(scenarios())}.")
    every: list[Play] = []
    for name in (name for name in scenarios() if name in names or not names):
        drawn = scenarios()[name].seeds(seeds, quick)
        fewer = drawn[:ABLATED_SEEDS] if name in ABLATED_IN and not contenders else []
        for chosen, those in ((contenders or AVOIDANCE, drawn), (ABLATED, fewer)):
            every += [({"scenario": name, "contender": contender}, seed) for contender in chosen for seed in those]
    return every


def trial(world: str, arm: str, cell: Cell, seed: int) -> Row:
    """Play a trial of a contender; its seed draws arm and sensors from `world`, if that names a set."""
    scenario = scenarios()[cell["scenario"]]
    scene = setting(scenario, profile(profile_text(cell["contender"])), seed, arm)
    record = play(replace(scene.setup, world=world), scene.done)
    own = {"family": scenario.family} | ({"world": world} if world else {})
    return own | measured(record, scene, scenario)


def summarise(rows: list[Row]) -> Row:
    """Summarise trials.

    Returns:
        `cells`, one for each scenario and contender; `ablations`, cells of `pretouch` unchanged and with one switch off
        at a time, on the same seeds.
    """
    # a time without an end is infinite
    ended = [row | {"cycle_time_s": (row["cycle_time_s"] or inf) if row["timed"] else None} for row in rows]
    off = [row for row in ended if row["contender"].startswith(WITHOUT)]
    whole = [row for row in ended if not row["contender"].startswith(WITHOUT)]
    played = {(row["scenario"], row["seed"]) for row in off}
    on = [row for row in whole if row["contender"] == BASE and (row["scenario"], row["seed"]) in played]
    return {
        "cells": summary(whole, ("scenario", "family", "contender"), _SPREAD, _TOTALS),
        "ablations": summary(on + off, ("scenario", "family", "contender"), _SPREAD, _TOTALS),
    }


def tables(summary: Row) -> list[TextTable]:
    """Return the losses, a table of contenders and scenarios for each family, and the ablations."""
    texts = {scene.family: scene.text for scene in scenarios().values()}
    note = (
        "Fewer seeds than in the tables above; pretouch has the same seeds here. The tables of contact detection have"
        " the switches of detection."
    )
    by_scene = [cell for _, cells in grouped(summary["ablations"], ("scenario",)) for cell in cells]
    every = [
        losses(summary["cells"]),
        *(
            table(f"{family.capitalize()}: contact and cost", _COLUMNS, cells, f"{texts[family]} {_NOTE}", 2)
            for family, cells in ((key["family"], cells) for key, cells in grouped(summary["cells"], ("family",)))
        ),
        table("Pretouch with one switch off at a time, in the closed loop", _ABLATED, by_scene, note, 2),
    ]
    return [each for each in every if each.rows]


def losses(cells: list[Row]) -> TextTable:
    """Return each measure of each scenario whose median is better for another contender by more than 5 %."""
    lines = []
    for key, group in grouped(cells, ("scenario",)):
        for ours in (cell for cell in group if cell["contender"] == BASE):
            for column in (*_LESS, *_MORE):
                text = column.text(ours)
                better = [cell for cell in _better(group, ours, column) if column.text(cell) != text]
                if better:
                    others = ", ".join(f"{cell['contender']} {column.text(cell)}" for cell in better)
                    lines.append((key["scenario"], column.heading, text, others))
    return TextTable(
        "Where others do better than pretouch",
        ("scenario", "median of", "pretouch", "better"),
        tuple(lines),
        "Every measure of every scenario in which another contender's median is better by more than 5 % and in the"
        " digits shown, whatever that contender loses elsewhere; > is a time that did not end in its trial.",
    )


def _better(group: list[Row], ours: Row, column: Column) -> list[Row]:
    """Return the cells that are better than the cell of `pretouch`, the best first."""

    def cost(cell: Row) -> float:
        spread = cell[column.key]
        if spread is None or spread["median"] is None:
            return inf
        return float(-spread["median"] if column in _MORE else spread["median"])

    own = cost(ours)
    if ours[column.key] is None:
        return []
    better = [cell for cell in group if own - cost(cell) > _NOTICED * min(max(abs(own), abs(cost(cell))), 1e9)]
    return sorted(better, key=cost)
