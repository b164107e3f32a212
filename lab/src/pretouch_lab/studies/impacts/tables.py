"""The study of the units' accelerometers: its summary and tables."""

from collections.abc import Callable
from itertools import product

import numpy as np

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.rows import Row, rounded
from pretouch_lab.studies.impacts.kinds import GROUPS, KINDS
from pretouch_lab.studies.located import COLUMNS, DETECTED, FIRM, NOTE, SIDES, chosen, compared
from pretouch_lab.tables import plain

ALL, LATER = "all", "alarm both ways"


def summarise(rows: list[Row]) -> Row:
    """Delays, misses and links of each way and kind, and of each kind and group of links; false alarms of each way."""
    cells, free = [], []
    for way, name in dict.fromkeys((row["way"], row["profile"]) for row in rows):
        own = [row for row in rows if (row["way"], row["profile"]) == (way, name)]
        for kind, group in product((ALL, *KINDS), (ALL, *GROUPS)):
            found = [
                c for row in own for c in row["contacts"] if kind in (ALL, c["kind"]) and group in (ALL, c["group"])
            ]
            if found:
                where = {"way": way, "profile": name, "kind": kind, "group": group, "contacts": len(found)}
                cells.append(where | {side: _measured([c[side] for c in found]) for side in SIDES} | _paired(found))
        hours = rounded(sum(row["hours"] for row in own), 4)
        free.append({"way": way, "profile": name, "hours": hours} | {side: _free(own, side) for side in SIDES})
    return {"cells": cells, "where": _where(rows), "free": free}


def _where(rows: list[Row]) -> list[Row]:
    """Places said of firm contacts, of all detected ones, and of these a while after the alarm: by way and kind."""
    found = []
    for way, name in dict.fromkeys((row["way"], row["profile"]) for row in rows):
        contacts = [c for row in rows if (row["way"], row["profile"]) == (way, name) for c in row["contacts"]]
        for kind in (ALL, *KINDS):
            own = [
                c | {"where": {side: c[side]["where"] for side in SIDES}} for c in contacts if kind in (ALL, c["kind"])
            ]
            later = [{side: c[side].get("where_later") for side in SIDES} for c in own]
            sets = {which: [c["where"] for c in chosen(own, which)] for which in (FIRM, DETECTED)}
            sets[LATER] = [said for said in later if all(said.values())]
            found += [
                {"way": way, "profile": name, "kind": kind, "of": which} | compared(said)
                for which, said in sets.items()
                if said
            ]
    return found


def _measured(contacts: list[Row]) -> Row:
    delays = [c["delay_s"] for c in contacts if c["delay_s"] is not None]
    median, late = np.percentile(delays, [50, 95]).tolist() if delays else (None, None)
    return {
        "median_s": None if median is None else rounded(median, 4),
        "p95_s": None if late is None else rounded(late, 4),
        "missed": len(contacts) - len(delays),
        "cued": sum(c["cued"] for c in contacts),
        **{key: _share(contacts, key) for key in ("by_imu", "by_imu_near", "by_both", "by_both_near")},
    }


def _share(contacts: list[Row], key: str) -> list[int]:
    """How many are so, and of how many that is known."""
    known = [c[key] for c in contacts if c.get(key) is not None]
    return [sum(known), len(known)]


def _paired(contacts: list[Row]) -> Row:
    """Of contacts detected either way: how many earlier and later with IMUs, and the mean of the difference."""
    both = [(c["with"]["delay_s"], c["without"]["delay_s"]) for c in contacts]
    gained = [a - b for a, b in both if a is not None and b is not None]
    return {
        "earlier": sum(g < 0 for g in gained),
        "later": sum(g > 0 for g in gained),
        "mean_change_s": rounded(float(np.mean(gained)), 5) if gained else None,
        "found": sum(a is not None and b is None for a, b in both),
        "lost": sum(a is None and b is not None for a, b in both),
    }


def _free(rows: list[Row], side: str) -> Row:
    parts = [row[side] for row in rows]
    return {
        "alarms": sum(part["alarms"] for part in parts),
        "cued": rounded(float(np.mean([part["cued"] for part in parts])), 5),
        "mean_gain": rounded(float(np.mean([part["mean_gain"] for part in parts])), 4),
    }


def tables(part: Row) -> list[TextTable]:
    """What the accelerometers change of delay, of the touched link, and of false alarms."""
    pooled = [cell for cell in part["cells"] if cell["group"] == ALL]
    first = part["cells"][0]["way"] if part["cells"] else ""
    own = [c for c in part["cells"] if c["way"] == first]
    kind = ("contact", plain("kind"))
    return [
        tabulated(
            "Contacts with the units' accelerometers and without: delay and misses",
            (("way", plain("way")), kind, *_DELAYS),
            pooled,
            "Each number without, then with. Way: usual, datagrams every 20 ms and a vibration of 0.3 m/s^2; calm 0.1,"
            " shaken 0.5 m/s^2; at once, datagrams every 2.5 ms. Impact: a hand of 0.6 kg and 75 N/mm at 0.1 to 0.5"
            " m/s. Push: 20 N, risen in 20 to 300 ms. Delay: from the true force passing 1 N. Change: mean of contacts"
            " detected either way.",
        ),
        tabulated(
            f"The same by group of links, way {first}",
            (("links", plain("group")), kind, *_DELAYS),
            [c for c in own if c["group"] != ALL],
            "As above.",
        ),
        tabulated(
            f"The touched link, way {first}",
            (("links", plain("group")), kind, *_LINKS),
            own,
            "Cue: contacts with a gain of 2 or more within 100 ms. IMU: the link with the largest gain is the touched"
            " one, of these. Torques: so is that of the sequential test's best force, 30 ms after its alarm, of the"
            " contacts detected. Both: with the gains of the accelerometers. +-1: or a link next to it.",
        ),
        tabulated(
            "Where contacts are said to be",
            (("way", plain("way")), kind, ("of", plain("of")), *COLUMNS),
            part["where"],
            f"{NOTE} An impact ends after 10 ms, and little is detected by then. Alarm both ways: contacts that gave"
            " one without and with, each judged 30 ms after its own.",
            names=3,
        ),
        tabulated(
            "Free motion",
            _FREE,
            part["free"],
            "Cue: steps with a gain of 2 or more on any link. Mean gain: over steps and links, 1 without.",
        ),
    ]


def _both(key: str) -> Callable[[Row], str]:
    return lambda cell: " / ".join("-" if (v := cell[side][key]) is None else f"{1000 * v:.0f}" for side in SIDES)


def _change(cell: Row) -> str:
    return "-" if cell["mean_change_s"] is None else f"{1000 * cell['mean_change_s']:+.1f}"


def _shared(side: str, key: str) -> Callable[[Row], str]:
    def write(cell: Row) -> str:
        some, of = cell[side][key]
        return f"{100 * some / of:.0f} %" if of else "-"

    return write


_DELAYS = (
    ("n", plain("contacts")),
    ("median\n[ms]", _both("median_s")),
    ("95 %\n[ms]", _both("p95_s")),
    ("missed", lambda cell: f"{cell['without']['missed']} / {cell['with']['missed']}"),
    ("earlier", plain("earlier")),
    ("later", plain("later")),
    ("change\n[ms]", _change),
)
_LINKS = (
    ("cue", lambda cell: f"{cell['with']['cued']}/{cell['contacts']}"),
    ("IMU", _shared("with", "by_imu")),
    ("IMU\n+-1", _shared("with", "by_imu_near")),
    ("torques", _shared("without", "by_both")),
    ("torques\n+-1", _shared("without", "by_both_near")),
    ("both", _shared("with", "by_both")),
    ("both\n+-1", _shared("with", "by_both_near")),
)
_FREE = (
    ("way", plain("way")),
    ("profile", plain("profile")),
    ("hours", plain("hours", ".2f")),
    ("alarms\nwithout", lambda f: str(f["without"]["alarms"])),
    ("alarms\nwith", lambda f: str(f["with"]["alarms"])),
    ("cue\n[%]", lambda f: f"{100 * f['with']['cued']:.2f}"),
    ("mean\ngain", lambda f: f"{f['with']['mean_gain']:.2f}"),
)
