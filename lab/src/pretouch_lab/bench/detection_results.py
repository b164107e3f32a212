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
HARD, HARD_CONTACTS, UNTOLD = "hard: all", "hard, touched: all", "untold-load"
"""Scenarios of the goals on arms with the flaws of real ones, and the motion that is no part of it: its loads may give
an alarm each."""
Groups = dict[str, Row]
"""Values that all rows of a group have, by the group's name."""
_USUAL = {"arm": "nominal", "sensing": "nominal", "goal": True}
_AT_GOAL = {"arm": "nominal", "pace": "goal"}
_NEAR = {"nobody near": "nothing", "somebody standing": "standing", "somebody passing": "passing"}


def results(rows: list[Row]) -> Row:
    """Return what the numbers of the benchmark hold, of a row for each arm and detector."""
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


def arms_of(rows: list[Row], family: str) -> list[Row]:
    """Return the rows of a family, each with what tells groups apart: its arm, its pace, whether loads are told."""
    goal = scenario("contacts")["goal"]["speed_m_s"]

    def apart(row: Row) -> Row:
        pace = "standing" if not row["speed_m_s"] else "goal" if row["speed_m_s"] == goal else "slower"
        return {"arm": row["kind"], "pace": pace, "told": row["path"] != UNTOLD}

    return [row | apart(row) for row in rows if row["family"] == family]


def contacts_of(arms: list[Row]) -> list[Row]:
    """Return the contacts of arms, each with its arm's values and whether the goals of delay are set for it."""
    goal = scenario("contacts")["goal"]

    def is_clear(contact: Row) -> bool:
        long, strong = contact["duration_s"] >= goal["duration_s"], contact["force_n"] >= goal["force_n"]
        return bool(long and strong and contact["detectable"] and contact["link"] in goal["links"])

    return [{**arm, **each, "goal": is_clear(each)} for arm in arms for each in arm.get("contacts", ())]


def group(rows: list[Row], where: Row) -> list[Row]:
    """Return the rows that have some values."""
    return [row for row in rows if where.items() <= row.items()]


def free_groups() -> Groups:
    """Return groups of arms in free motion, by name."""
    return {
        GOAL_FREE: _AT_GOAL,
        **{f"{GOAL_FREE}, {name}": _AT_GOAL | {"near": who} for name, who in _NEAR.items()},
        **{f"free: {pace}": {"arm": "nominal", "pace": pace} for pace in ("slower", "standing")},
        **{f"free: {kind}": {"arm": kind} for kind in scenario("arms") if kind != "nominal"},
        "free: all": {},
    }


def contact_groups(contacts: list[Row]) -> Groups:
    """Return groups of contacts, by name: of the goals by speed, of all by kind, and of other arms and skins."""
    speeds = sorted({contact["speed_m_s"] for contact in contacts})
    kinds = dict.fromkeys(contact["kind"] for contact in contacts)
    others = dict.fromkeys((contact["arm"], contact["sensing"]) for contact in contacts)
    others.pop(("nominal", "nominal"), None)
    return {
        GOAL_CONTACTS: _USUAL,
        **{f"contacts: {speed:g} m/s": _USUAL | {"speed_m_s": speed} for speed in speeds},
        **{f"contacts: {kind}": {"arm": "nominal", "sensing": "nominal", "kind": kind} for kind in kinds},
        **{
            f"contacts: {sensing if arm == 'nominal' else arm}": {"arm": arm, "sensing": sensing, "goal": True}
            for arm, sensing in others
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


def delays(every: list[float | None]) -> Row:
    """Summarise delays [s]: of what was detected; contacts that came while an alarm was answered are apart."""
    judged = [value for value in every if value != BUSY]
    at = [value for value in judged if value is not None]
    return {
        "median_delay_s": rounded(float(np.median(at)), 4) if at else None,
        "p95_delay_s": rounded(float(np.percentile(at, 95)), 4) if at else None,
        "median_bounds_s": [rounded(bound, 4) for bound in median_bounds(at)] if at else None,
        "missed": len(judged) - len(at),
        "contacts": len(judged),
        "busy": len(every) - len(judged),
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
    """Return false alarms, delays and misses of each contender on arms with the flaws of real ones, by motion."""
    groups: Groups = {
        HARD: {"told": True},
        **{f"{HARD}, {name}": {"told": True, "near": who} for name, who in _NEAR.items()},
        **{f"hard: {motion}": {"path": motion} for motion in dict.fromkeys(row["path"] for row in arms)},
    }
    touched = {name.replace("hard", "hard, touched"): where | {"detectable": True} for name, where in groups.items()}
    free = [row for row in arms if row["near"] != "touched"]
    return [*free_rows(free, contenders, groups), *contact_rows(contacts_of(arms), contenders, touched)]


def ablation_rows(free: list[Row], touched: list[Row]) -> list[Row]:
    """Return `pretouch` and its ablations on the arms that ablations are given."""
    compared = (DETECTORS[-1], *ablated())
    arms, contacts = group(free, {"ablated": True}), contacts_of(group(touched, {"ablated": True}))
    return [
        *free_rows(arms, compared, {ABLATED_FREE: {}}),
        *contact_rows(contacts, compared, {ABLATED_CONTACTS: {"goal": True}}),
    ]


def curves(free: list[Row], contacts: list[Row]) -> list[Row]:
    """Return delay against false alarms for the contacts and the free motion of the goals, value by value."""
    points = []
    for contender in DETECTORS:
        own = {"contender": contender.name}
        arms, touches = group(free, _AT_GOAL | own), group(contacts, _USUAL | own)
        hours = sum(row["hours"] for row in arms)
        for k, value in enumerate(sweep_values(contender)):
            point: Row = (
                own | {contender.sweep: value} | (rate([row["sweep"][k] for row in arms], hours) if hours else {})
            )
            for seen, name in ((True, "seen"), (False, "unseen")):
                point[name] = delays([contact["sweep_s"][k] for contact in group(touches, {"seen": seen})])
            points.append(point)
    return points


def resolution(free: list[Row]) -> str:
    """Say what a count of no false alarm would tell."""
    own = group(free, {"contender": DETECTORS[-1].name})
    every, most = (sum(row["hours"] for row in group(own, where)) for where in ({}, _AT_GOAL))
    if not most:
        return "There is no free motion at the goal's speed: nothing can be said of false alarms."
    return (
        f"{every:.2g} h of free motion. No false alarm in the {most:.2g} h at the goal's speed means fewer than"
        f" {rate_bounds(0, most)[1]:.2g} an hour (95 %)."
    )
