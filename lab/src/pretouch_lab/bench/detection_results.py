"""Results of the detection benchmark over all rows: rates with their bounds, delays, missed contacts.

A group of arms or of contacts is declared by the values that its rows share.
"""

from collections.abc import Sequence

import numpy as np

from pretouch_lab.bench.contenders import DETECTORS, Contender, ablated
from pretouch_lab.bench.detection import BUSY, FAMILIES, sweep_values
from pretouch_lab.bench.scenes import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import dispersion_of, rate_bounds, rounded

GOAL_FREE, GOAL_CONTACTS = "free: goal", "contacts: goal"
"""Scenarios of the goals: the nominal arm at the goal's speed, with any bystander; contacts with a goal of delay, on
the nominal arm with the nominal skin."""
ABLATED_FREE, ABLATED_CONTACTS = "free: ablations", "contacts: ablations"
"""The parts of these scenarios that ablations replay."""
HARD, HARD_CONTACTS, UNTOLD = "hard: all", "hard, touched: all", "untold-load"
"""Scenarios of the goals on hard arms, with the errors of real ones, and the motion outside them: each of its loads may
cause an alarm."""
Groups = dict[str, Row]
"""Values that the rows of a group share, by the group's name."""
_USUAL = {"arm": "nominal", "sensing": "nominal", "goal": True}
_AT_GOAL = {"arm": "nominal", "pace": "goal"}
_NEAR = {"nobody near": "nothing", "somebody standing": "standing", "somebody passing": "passing"}


def results(rows: list[Row]) -> Row:
    """Return the numbers of the benchmark from a row for each arm and detector."""
    free, touched, hard = (arms_of(rows, family) for family in FAMILIES)
    contacts, replayed, compared = contacts_of(touched), {"ablated": True}, (DETECTORS[-1], *ablated())
    return {
        "resolution": resolution(free),
        "rows": [
            *free_rows(free, DETECTORS, free_groups()),
            *contact_rows(contacts, DETECTORS, contact_groups(contacts)),
            *hard_rows(hard, DETECTORS),
            *free_rows(group(free, replayed), compared, {ABLATED_FREE: {}}),
            *contact_rows(group(contacts, replayed), compared, {ABLATED_CONTACTS: {"goal": True}}),
        ],
        "curves": curves(free, contacts),
    }


def arms_of(rows: list[Row], family: str) -> list[Row]:
    """Return the rows of a family with the values that groups use: arm, pace, and `told` (loads are declared)."""
    goal = scenario("contacts")["goal"]["speed_m_s"]

    def apart(row: Row) -> Row:
        pace = "standing" if not row["speed_m_s"] else "goal" if row["speed_m_s"] == goal else "slower"
        return {"arm": row["kind"], "pace": pace, "told": row["path"] != UNTOLD}

    return [row | apart(row) for row in rows if row["family"] == family]


def contacts_of(arms: list[Row]) -> list[Row]:
    """Return the contacts of arms, each with its arm's values and `goal`, true for contacts with a goal of delay."""
    goal = scenario("contacts")["goal"]

    def is_clear(contact: Row) -> bool:
        long, strong = contact["duration_s"] >= goal["duration_s"], contact["force_n"] >= goal["force_n"]
        return bool(long and strong and contact["detectable"] and contact["link"] in goal["links"])

    return [{**arm, **each, "goal": is_clear(each)} for arm in arms for each in arm.get("contacts", ())]


def group(rows: list[Row], where: Row) -> list[Row]:
    """Return the rows with the values of `where`."""
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
    """Return groups of contacts, by name: goals by speed, all by kind, and other arms and skins."""
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
    """Return a rate [1/h] with 95 % bounds from each arm's count: Poisson bounds, wider if arms differ."""
    low, high = rate_bounds(sum(counts), hours, dispersion_of(counts))
    return {
        "false_alarms_per_hour": rounded(sum(counts) / hours, 4),
        "low_per_hour": rounded(low, 4),
        "high_per_hour": rounded(high, 4),
        "false_alarms": sum(counts),
        "hours": rounded(hours, 4),
    }


def delays(every: list[float | None]) -> Row:
    """Summarise delays [s] of detected contacts; contacts during the reaction to an earlier alarm count as busy."""
    countable = [value for value in every if value != BUSY]
    at = [value for value in countable if value is not None]
    return {
        "median_delay_s": rounded(float(np.median(at)), 4) if at else None,
        "p95_delay_s": rounded(float(np.percentile(at, 95)), 4) if at else None,
        "missed": len(countable) - len(at),
        "contacts": len(countable),
        "busy": len(every) - len(countable),
    }


def free_rows(arms: list[Row], contenders: Sequence[Contender], groups: Groups) -> list[Row]:
    """Return the false alarms of each contender in each group of arms with free motion."""
    return [
        {"contender": contender.name, "scenario": name}
        | rate([row["alarms"] for row in some], sum(row["hours"] for row in some))
        for contender in contenders
        for name, where in groups.items()
        if (some := group(arms, where | {"contender": contender.name}))
    ]


def contact_rows(contacts: list[Row], contenders: Sequence[Contender], groups: Groups) -> list[Row]:
    """Return delays and missed contacts of each contender and group, for contacts seen and not seen by the skin."""
    return [
        {"contender": contender.name, "scenario": name, "seen": visible}
        | delays([contact["delay_s"] for contact in some])
        | {"towards": sum(bool(contact["towards"]) for contact in some)}
        for contender in contenders
        for name, where in groups.items()
        for visible in (True, False)
        if (some := group(contacts, where | {"contender": contender.name, "seen": visible}))
    ]


def hard_rows(arms: list[Row], contenders: Sequence[Contender]) -> list[Row]:
    """Return false alarms, delays and missed contacts of each contender on hard arms, by motion."""
    groups: Groups = {
        HARD: {"told": True},
        **{f"{HARD}, {name}": {"told": True, "near": who} for name, who in _NEAR.items()},
        **{f"hard: {motion}": {"path": motion} for motion in dict.fromkeys(row["path"] for row in arms)},
    }
    touched = {name.replace("hard", "hard, touched"): where | {"detectable": True} for name, where in groups.items()}
    free = [row for row in arms if row["near"] != "touched"]
    return [*free_rows(free, contenders, groups), *contact_rows(contacts_of(arms), contenders, touched)]


def curves(free: list[Row], contacts: list[Row]) -> list[Row]:
    """Return delays and false alarms in the scenarios of the goals, for each value of a sweep."""
    points = []
    for contender in DETECTORS:
        own = {"contender": contender.name}
        arms, touches = group(free, _AT_GOAL | own), group(contacts, _USUAL | own)
        hours = sum(row["hours"] for row in arms)
        for k, value in enumerate(sweep_values(contender)):
            point: Row = (
                own | {contender.sweep: value} | (rate([row["sweep"][k] for row in arms], hours) if hours else {})
            )
            for visible, name in ((True, "seen"), (False, "unseen")):
                point[name] = delays([contact["sweep_s"][k] for contact in group(touches, {"seen": visible})])
            points.append(point)
    return points


def resolution(free: list[Row]) -> str:
    """Return a sentence on the bound that a count of zero false alarms gives."""
    own = group(free, {"contender": DETECTORS[-1].name})
    every, most = (sum(row["hours"] for row in group(own, where)) for where in ({}, _AT_GOAL))
    if not most:
        return "There is no free motion at the goal's speed, and so no rate of false alarms."
    return (
        f"{every:.2g} h of free motion. No false alarm in the {most:.2g} h at the goal's speed means fewer than"
        f" {rate_bounds(0, most)[1]:.2g} an hour (95 %)."
    )
