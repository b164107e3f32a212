"""What all rows of the detection benchmark say together: rates with their bounds, delays, what was missed."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch_lab.baselines.detection import BASELINES, Baseline, ablated
from pretouch_lab.benchmarks.bench import EMPTY
from pretouch_lab.benchmarks.detection.judge import BUSY, sweep_values
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import dispersion_of, median_bounds, rate_bounds, rounded

GOAL_FREE, GOAL_CONTACTS = "free: goal", "contacts: goal"
"""Scenarios of the goals: the usual arm at the goal's speed, whoever is near; contacts the goals of delay are set for,
on the usual arm with the usual skin."""
ABLATED_FREE, ABLATED_CONTACTS = "free: ablations", "contacts: ablations"
"""Of those, what ablations were given."""


@dataclass(frozen=True)
class Rows:
    """All rows that are there."""

    free: list[Row]
    contacts: list[Row]
    hard: list[Row]
    """Of arms as unkind as real ones, free or touched."""


def free_scenarios() -> dict[str, Callable[[Row], bool]]:
    """Return groups of cells in free motion, by name."""
    speed = scenario("contacts")["goal"]["speed_m_s"]

    def usual(row: Row, near: tuple[str, ...] = ("nothing", "standing", "passing")) -> bool:
        return row["kind"] == "nominal" and row["near"] in near

    groups: dict[str, Callable[[Row], bool]] = {
        GOAL_FREE: lambda row: usual(row) and row["speed_m_s"] == speed,
        "free: goal, nobody near": lambda row: usual(row, ("nothing",)) and row["speed_m_s"] == speed,
        "free: goal, somebody standing": lambda row: usual(row, ("standing",)) and row["speed_m_s"] == speed,
        "free: goal, somebody passing": lambda row: usual(row, ("passing",)) and row["speed_m_s"] == speed,
        "free: slower": lambda row: usual(row) and 0.0 < row["speed_m_s"] < speed,
        "free: standing": lambda row: usual(row) and row["speed_m_s"] == 0.0,
    }
    for kind in scenario("arms"):
        if kind != "nominal":
            groups[f"free: {kind}"] = lambda row, kind=kind: row["kind"] == kind  # type: ignore[misc]
    return groups | {"free: all": lambda row: True}


def rate(counts: list[int], hours: float) -> Row:
    """Return a rate [1/h] with 95 % bounds, of the counts of each arm: Poisson's, wider where arms differ."""
    low, high = rate_bounds(sum(counts), hours, dispersion_of(counts))
    return {
        "false_alarms_per_hour": rounded(sum(counts) / hours, 4),
        "low_per_hour": rounded(low, 4),
        "high_per_hour": rounded(high, 4),
        "false_alarms": sum(counts),
        "hours": rounded(hours, 4),
    }


def free_rows(
    rows: Rows, baselines: Iterable[Baseline], groups: dict[str, Callable[[Row], bool]] | None = None
) -> list[Row]:
    """Return the false alarms of each baseline in each group of cells there are hours of."""
    found, groups = [], groups or free_scenarios()
    for baseline in baselines:
        own = [row for row in rows.free if row["contender"] == baseline.name]
        for name, belongs in groups.items():
            group = [row for row in own if belongs(row)]
            if group:
                values = rate([row["alarms"] for row in group], sum(row["hours"] for row in group))
                found.append({**EMPTY, "contender": baseline.name, "scenario": name, **values})
    return found


def wanted(_cell: Row, contact: Row) -> bool:
    """Whether a contact is one of those the goals of delay are set for."""
    goal = scenario("contacts")["goal"]
    strong = contact["force_n"] >= goal["force_n"] and contact["duration_s"] >= goal["duration_s"]
    return bool(strong and contact["detectable"] and contact["link"] in goal["links"])


def contact_scenarios(rows: Rows) -> dict[str, Callable[[Row, Row], bool]]:
    """Return groups of contacts, by name: each says of a cell's row and a contact whether it belongs."""

    def usual(cell: Row) -> bool:
        return cell["kind"] == "nominal" and cell["sensing"] == "nominal"

    groups: dict[str, Callable[[Row, Row], bool]] = {
        GOAL_CONTACTS: lambda cell, contact: usual(cell) and wanted(cell, contact),
    }
    for speed in sorted({cell["speed_m_s"] for cell in rows.contacts}):
        groups[f"contacts: {speed:g} m/s"] = lambda cell, contact, speed=speed: (  # type: ignore[misc]
            usual(cell) and wanted(cell, contact) and cell["speed_m_s"] == speed
        )
    for kind in dict.fromkeys(c["kind"] for cell in rows.contacts for c in cell["contacts"]):
        groups[f"contacts: {kind}"] = lambda cell, contact, kind=kind: usual(cell) and contact["kind"] == kind  # type: ignore[misc]
    others = dict.fromkeys((cell["kind"], cell["sensing"]) for cell in rows.contacts if not usual(cell))
    for kind, sensing in others:
        name = sensing if kind == "nominal" else kind
        groups[f"contacts: {name}"] = lambda cell, contact, both=(kind, sensing): (  # type: ignore[misc]
            (cell["kind"], cell["sensing"]) == both and wanted(cell, contact)
        )
    return groups | {"contacts: all": lambda cell, contact: True}


def delays(found: list[float | None]) -> Row:
    """Summarise delays [s]: of what was detected; contacts that came while an alarm was answered are apart."""
    known = [value for value in found if value != BUSY]
    at = [value for value in known if value is not None]
    return {
        "median_delay_s": rounded(float(np.median(at)), 4) if at else None,
        "p95_delay_s": rounded(float(np.percentile(at, 95)), 4) if at else None,
        "median_bounds_s": [rounded(bound, 4) for bound in median_bounds(at)] if at else None,
        "missed": len(known) - len(at),
        "contacts": len(known),
        "busy": len(found) - len(known),
    }


def contact_rows(
    rows: Rows, baselines: Iterable[Baseline], groups: dict[str, Callable[[Row, Row], bool]] | None = None
) -> list[Row]:
    """Return delays and misses of each baseline in each group of contacts, seen and not seen by the skin."""
    found = []
    for baseline in baselines:
        for name, group in grouped(rows, baseline.name, groups).items():
            for seen in (True, False):
                some = [contact for contact in group if contact["seen"] is seen]
                if some:
                    towards = sum(bool(contact["towards"]) for contact in some)
                    values = delays([contact["delay_s"] for contact in some]) | {"towards": towards}
                    where = {"contender": baseline.name, "scenario": name, "seen": seen}
                    found.append({**EMPTY, **where, **values})
    return found


def grouped(
    rows: Rows, baseline: str, groups: dict[str, Callable[[Row, Row], bool]] | None = None
) -> dict[str, list[Row]]:
    """Return a baseline's contacts by the name of their group."""
    cells = [cell for cell in rows.contacts if cell["contender"] == baseline]
    return {
        name: [contact for cell in cells for contact in cell["contacts"] if belongs(cell, contact)]
        for name, belongs in (groups or contact_scenarios(rows)).items()
    }


def ablation_rows(rows: Rows) -> list[Row]:
    """Return `pretouch` and its ablations on the streams that ablations were given."""
    names = {baseline.name for baseline in ablated()}

    def given(cells: list[Row]) -> list[Row]:
        seeds = {cell["seed"] for cell in cells if cell["contender"] in names}
        return [cell for cell in cells if cell["seed"] in seeds]

    compared = (BASELINES[-1], *ablated())
    part = Rows(given(rows.free), given(rows.contacts), [])
    return [
        *free_rows(part, compared, {ABLATED_FREE: lambda row: True}),
        *contact_rows(part, compared, {ABLATED_CONTACTS: wanted}),
    ]


HARD, UNTOLD = "hard: all", "untold-load"
"""Scenario of the goals on arms as unkind as real ones, and the motion that is no part of it: its loads may give an
alarm each."""


def hard_rows(rows: Rows, baselines: Iterable[Baseline]) -> list[Row]:
    """Return false alarms, delays and misses of each baseline on arms as unkind as real ones, by motion."""
    free = [row for row in rows.hard if row["near"] != "touched"]
    touched = [row for row in rows.hard if row["near"] == "touched"]
    groups: dict[str, Callable[[Row], bool]] = {
        HARD: lambda row: row["motion"] != UNTOLD,
        "hard: all, nobody near": lambda row: row["motion"] != UNTOLD and row["near"] == "nothing",
        "hard: all, somebody standing": lambda row: row["motion"] != UNTOLD and row["near"] == "standing",
    }
    for motion in dict.fromkeys(row["motion"] for row in rows.hard):
        groups[f"hard: {motion}"] = lambda row, motion=motion: row["motion"] == motion  # type: ignore[misc]
    of_contacts: dict[str, Callable[[Row, Row], bool]] = {
        name.replace("hard", "hard, touched"): lambda cell, contact, of=of: of(cell) and contact["detectable"]  # type: ignore[misc]
        for name, of in groups.items()
    }
    parts = Rows(free, touched, [])
    return [*free_rows(parts, baselines, groups), *contact_rows(parts, baselines, of_contacts)]


def curves(rows: Rows, baselines: Iterable[Baseline]) -> list[Row]:
    """Return delay against false alarms for the contacts and the free motion of the goals, value by value."""
    found, belongs = [], free_scenarios()[GOAL_FREE]
    for baseline in baselines:
        free = [row for row in rows.free if row["contender"] == baseline.name and belongs(row)]
        contacts = grouped(rows, baseline.name)[GOAL_CONTACTS]
        hours = sum(row["hours"] for row in free)
        for k, value in enumerate(sweep_values(baseline)):
            point: dict[str, Any] = {"contender": baseline.name, baseline.sweep: value}
            point |= rate([row["sweep"][k] for row in free], hours) if hours else {}
            for seen, name in ((True, "seen"), (False, "unseen")):
                some = [contact["sweep_s"][k] for contact in contacts if contact["seen"] is seen]
                point[name] = delays(some)
            found.append(point)
    return found


def resolution(rows: Rows) -> str:
    """Say what a count of no false alarm would tell."""
    belongs = free_scenarios()[GOAL_FREE]
    most = max(
        (sum(row["hours"] for row in rows.free if row["contender"] == baseline.name and belongs(row))
         for baseline in BASELINES),
    )  # fmt: skip
    if most <= 0.0:
        return "There is no free motion at the goal's speed: nothing can be said of false alarms."
    high = rate_bounds(0, most)[1]
    every = sum(row["hours"] for row in rows.free if row["contender"] == BASELINES[-1].name)
    return (
        f"{every:.2g} h of free motion. No false alarm in the {most:.2g} h at the goal's speed means fewer than"
        f" {high:.2g} an hour (95 %)."
    )
