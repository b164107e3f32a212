"""What all rows of the detection benchmark say together: rates with their bounds, delays, what was missed.

A group of arms, or of contacts, is declared by the values that its rows share.
"""

from collections.abc import Sequence

import numpy as np

from pretouch_lab.bench.contenders import DETECTORS, Contender, ablated
from pretouch_lab.bench.detection import BUSY, FAMILIES, sweep_values
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import dispersion_of, median_bounds, rate_bounds, rounded

GOAL_FREE, GOAL_CONTACTS = "free: goal", "contacts: goal"
"""Scenarios of the goals: the usual arm at the goal's speed, whoever is near; contacts the goals of delay are set for,
on the usual arm with the usual skin."""
ABLATED_FREE, ABLATED_CONTACTS = "free: ablations", "contacts: ablations"
"""Of those, what ablations were given."""
HARD, UNTOLD = "hard: all", "untold-load"
"""Scenario of the goals on arms as unkind as real ones, and the motion that is no part of it: its loads may give an
alarm each."""
Groups = dict[str, Row]
"""Values that all rows of a group have, by the group's name."""
_USUAL = {"arm": "nominal", "sensing": "nominal"}
_AT_GOAL = {"arm": "nominal", "pace": "goal"}


def arms_of(rows: list[Row], family: str) -> list[Row]:
    """Return the rows of a family, each with what tells groups apart: its arm, its pace, whether loads are told."""
    goal = scenario("contacts")["goal"]["speed_m_s"]
    return [
        row
        | {
            "arm": row.get("kind"),
            "pace": "standing" if not row.get("speed_m_s") else "goal" if row["speed_m_s"] == goal else "slower",
            "told": row.get("motion") != UNTOLD,
        }
        for row in rows
        if row["family"] == family
    ]


def contacts_of(arms: list[Row]) -> list[Row]:
    """Return the contacts of arms, each with its arm's values and whether the goals of delay are set for it."""
    goal = scenario("contacts")["goal"]
    return [
        {
            **arm,
            **contact,
            "goal": contact["force_n"] >= goal["force_n"]
            and contact["duration_s"] >= goal["duration_s"]
            and contact["detectable"]
            and contact["link"] in goal["links"],
        }
        for arm in arms
        for contact in arm.get("contacts", ())
    ]


def group(rows: list[Row], where: Row) -> list[Row]:
    """Return the rows that have some values."""
    return [row for row in rows if where.items() <= row.items()]


def free_groups() -> Groups:
    """Return groups of arms in free motion, by name."""
    near = {"nobody near": "nothing", "somebody standing": "standing", "somebody passing": "passing"}
    return {
        GOAL_FREE: _AT_GOAL,
        **{f"{GOAL_FREE}, {name}": _AT_GOAL | {"near": who} for name, who in near.items()},
        **{f"free: {pace}": {"arm": "nominal", "pace": pace} for pace in ("slower", "standing")},
        **{f"free: {kind}": {"arm": kind} for kind in scenario("arms") if kind != "nominal"},
        "free: all": {},
    }


def contact_groups(contacts: list[Row]) -> Groups:
    """Return groups of contacts, by name."""
    others = dict.fromkeys((contact["arm"], contact["sensing"]) for contact in contacts)
    return {
        GOAL_CONTACTS: _USUAL | {"goal": True},
        **{
            f"contacts: {speed:g} m/s": _USUAL | {"goal": True, "speed_m_s": speed}
            for speed in sorted({contact["speed_m_s"] for contact in contacts})
        },
        **{f"contacts: {kind}": _USUAL | {"kind": kind} for kind in dict.fromkeys(c["kind"] for c in contacts)},
        **{
            f"contacts: {sensing if arm == 'nominal' else arm}": {"arm": arm, "sensing": sensing, "goal": True}
            for arm, sensing in others
            if (arm, sensing) != ("nominal", "nominal")
        },
        "contacts: all": {},
    }


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


def free_rows(arms: list[Row], contenders: Sequence[Contender], groups: Groups) -> list[Row]:
    """Return the false alarms of each contender in each group of arms there are hours of."""
    return [
        {"contender": contender.name, "scenario": name}
        | rate([row["alarms"] for row in some], sum(row["hours"] for row in some))
        for contender in contenders
        for name, where in groups.items()
        if (some := group(arms, where | {"contender": contender.name}))
    ]


def contact_rows(contacts: list[Row], contenders: Sequence[Contender], groups: Groups) -> list[Row]:
    """Return delays and misses of each contender in each group of contacts, seen and not seen by the skin."""
    return [
        {"contender": contender.name, "scenario": name, "seen": seen}
        | delays([contact["delay_s"] for contact in some])
        | {"towards": sum(bool(contact["towards"]) for contact in some)}
        for contender in contenders
        for name, where in groups.items()
        for seen in (True, False)
        if (some := group(contacts, where | {"contender": contender.name, "seen": seen}))
    ]


def hard_rows(arms: list[Row], contenders: Sequence[Contender]) -> list[Row]:
    """Return false alarms, delays and misses of each contender on arms as unkind as real ones, by motion."""
    groups: Groups = {
        HARD: {"told": True},
        "hard: all, nobody near": {"told": True, "near": "nothing"},
        "hard: all, somebody standing": {"told": True, "near": "standing"},
        **{f"hard: {motion}": {"motion": motion} for motion in dict.fromkeys(row["motion"] for row in arms)},
    }
    touched = {name.replace("hard", "hard, touched"): where | {"detectable": True} for name, where in groups.items()}
    free = [row for row in arms if row["near"] != "touched"]
    return [*free_rows(free, contenders, groups), *contact_rows(contacts_of(arms), contenders, touched)]


def ablation_rows(free: list[Row], touched: list[Row]) -> list[Row]:
    """Return `pretouch` and its ablations on the streams that ablations were given."""
    names = {contender.name for contender in ablated()}
    seeds = [{row["seed"] for row in arms if row["contender"] in names} for arms in (free, touched)]
    compared = (DETECTORS[-1], *ablated())
    given = [[row for row in arms if row["seed"] in own] for arms, own in zip((free, touched), seeds, strict=True)]
    contacts = contacts_of(given[1])
    return [
        *free_rows(given[0], compared, {ABLATED_FREE: {}}),
        *contact_rows(contacts, compared, {ABLATED_CONTACTS: {"goal": True}}),
    ]


def curves(free: list[Row], contacts: list[Row]) -> list[Row]:
    """Return delay against false alarms for the contacts and the free motion of the goals, value by value."""
    points = []
    for contender in DETECTORS:
        arms = group(free, _AT_GOAL | {"contender": contender.name})
        hours = sum(row["hours"] for row in arms)
        for k, value in enumerate(sweep_values(contender)):
            point: Row = {"contender": contender.name, contender.sweep: value}
            point |= rate([row["sweep"][k] for row in arms], hours) if hours else {}
            for seen, name in ((True, "seen"), (False, "unseen")):
                where = _USUAL | {"goal": True, "contender": contender.name, "seen": seen}
                point[name] = delays([contact["sweep_s"][k] for contact in group(contacts, where)])
            points.append(point)
    return points


def resolution(free: list[Row]) -> str:
    """Say what a count of no false alarm would tell."""
    of_each = [group(free, _AT_GOAL | {"contender": contender.name}) for contender in DETECTORS]
    most = max(sum(row["hours"] for row in arms) for arms in of_each)
    if most <= 0.0:
        return "There is no free motion at the goal's speed: nothing can be said of false alarms."
    every = sum(row["hours"] for row in group(free, {"contender": DETECTORS[-1].name}))
    return (
        f"{every:.2g} h of free motion. No false alarm in the {most:.2g} h at the goal's speed means fewer than"
        f" {rate_bounds(0, most)[1]:.2g} an hour (95 %)."
    )


def results(rows: list[Row]) -> Row:
    """Return what the numbers of the benchmark hold, of the rows of its replays."""
    free, touched, hard = (arms_of(rows, family) for family in FAMILIES)
    contacts = contacts_of(touched)
    return {
        "resolution": resolution(free),
        "rows": [
            *free_rows(free, DETECTORS, free_groups()),
            *contact_rows(contacts, DETECTORS, contact_groups(contacts)),
            *hard_rows(hard, DETECTORS),
            *ablation_rows(free, touched),
        ],
        "curves": curves(free, contacts),
    }
