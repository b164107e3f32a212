"""What came of contacts on arms with touch sensors, and of false touches, as tables."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.paper.claims.detectors import rate_bounds
from pretouch_lab.rows import Row, grouped, rounded
from pretouch_lab.studies.located import COLUMNS, DETECTED, FIRM, NOTE, SIDES, chosen, compared
from pretouch_lab.studies.tactile_kinds import INNER
from pretouch_lab.tables import plain


def summarise(rows: list[Row]) -> Row:
    """Contacts by place, sight and force: missed and delay with each detector; alarms of free motion."""
    contacts = [
        {"place": row["place"], "hand": row["hand"], **contact} for row in rows for contact in row.get("contacts", [])
    ]
    for contact in contacts:
        contact["busy"] = any(contact[name] is not None and contact[name] < 0 for name in SIDES)
    judged = sorted((c for c in contacts if not c["busy"]), key=lambda c: float(c["force_n"]))
    free = [row["free"] for row in rows if "free" in row]
    together = [{**contact, "force_n": "all"} for contact in judged]
    keys = ("place", "hand", "force_n")
    return {
        "where": _where(contacts),
        "cells": [where | _cell(group) for where, group in grouped(judged + together, keys)],
        "busy": sum(contact["busy"] for contact in contacts),
        "free": {name: sum(row[name] for row in free) for name in ("hours", "false_touches", *SIDES)} if free else None,
    }


def _where(contacts: list[Row]) -> list[Row]:
    """Places said of firm contacts and of all detected ones, by place and sight; of the inner links each alone too."""
    every = [{**contact, "link": "all"} for contact in contacts]
    inner = [contact for contact in contacts if contact["place"] == INNER]
    return [
        where | {"of": name} | compared([contact["where"] for contact in own])
        for where, group in grouped(every + inner, ("place", "hand", "link"))
        for name in (FIRM, DETECTED)
        if (own := chosen(group, name))
    ]


def _cell(group: list[Row]) -> Row:
    """Count what was missed; delays of the contacts that both found, so that they are compared on the same ones."""
    both = [c for c in group if c["without"] is not None and c["with"] is not None]
    found: dict[str, Any] = {
        "contacts": len(group),
        "heard": sum(c["heard_s"] is not None for c in group),
        "heard_ms": _median([c["heard_s"] for c in group if c["heard_s"] is not None]),
        "both": len(both),
    }
    for name in SIDES:
        found[f"missed_{name}"] = sum(c[name] is None for c in group)
        found[f"delay_{name}_ms"] = _median([c[name] for c in both])
    return found


def _median(seconds: list[float]) -> float | None:
    return rounded(1000 * float(np.median(seconds)), 1) if seconds else None


def tables(part: Row) -> list[TextTable]:
    """What touch changes of delay and missed contacts, and of false alarms."""
    made = []
    if part["cells"]:
        columns = (
            ("place", plain("place")),
            ("hand", plain("hand")),
            ("force\n[N]", lambda cell: cell["force_n"] if cell["force_n"] == "all" else f"{cell['force_n']:g}"),
            ("contacts", plain("contacts")),
            ("heard", plain("heard")),
            ("heard in\n[ms]", _ms("heard_ms")),
            *((f"missed\n{name}", plain(f"missed_{name}")) for name in SIDES),
            *((f"delay [ms]\n{name}", _ms(f"delay_{name}_ms")) for name in SIDES),
        )
        note = (
            "Contacts of 0.06 and 0.2 s on an arm on the circle at 0.3 m/s that does not react; profile pretouch"
            " without and with use_touch on the same recorded arms. Heard: contacts that a unit's touch sensor"
            " reported, and how long after the force passed 1 N that was (median). Delays: medians over the contacts"
            f" that both found. {part['busy']} contacts that began while an earlier alarm was still answered are left"
            " out."
        )
        made.append(tabulated("Contacts with touch sensors and without", columns, part["cells"], note, names=3))
    if part["where"]:
        where = (*((name, plain(name)) for name in ("place", "hand", "link")), ("contacts", plain("of")), *COLUMNS)
        title = "Where contacts are said to be, without touch and with"
        made.append(tabulated(title, where, part["where"], NOTE, names=4))
    if part["free"]:
        made.append(_free(part["free"]))
    return made


def _free(free: Row) -> TextTable:
    """What false touches make of free motion."""

    def bounds(side: str) -> str:
        return "{:.1f} to {:.1f}".format(*rate_bounds(free[side], max(free["hours"], 1e-9)))

    columns = (
        ("use of touch", str),
        ("hours", lambda _: f"{free['hours']:.2f}"),
        ("false\ntouches", lambda _: str(free["false_touches"])),
        ("alarms", lambda side: str(free[side])),
        ("alarms an hour\n95 %", bounds),
        ("alarms in 1000\nfalse touches", lambda side: f"{1000 * free[side] / max(free['false_touches'], 1):.1f}"),
    )
    return tabulated(
        "Free motion with false touches",
        columns,
        SIDES,
        "False touches of each unit at 600 an hour, so that they can be counted; a real one is assumed to have one"
        " an hour at most.",
        names=1,
    )


def _ms(key: str) -> Callable[[Row], str]:
    return lambda row: "-" if row[key] is None else f"{row[key]:.0f}"
