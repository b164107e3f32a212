"""What all replays of the localisation benchmark say together."""

from collections.abc import Callable

import numpy as np

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.scenario_files import scenario
from pretouch_lab.run import Row
from pretouch_lab.table import rounded
from pretouch_lab.tables import plain


def rows_by_body(replays: list[Row]) -> list[Row]:
    """Return a row for each skin and rigid body."""
    rows = []
    for skin in dict.fromkeys(replay["skin"] for replay in replays):
        own = [replay for replay in replays if replay["skin"] == skin]
        rate = rounded(1.0 / max(replay["p99_s"] for replay in own), 1)
        singles = [found for replay in own for found in replay["found"]]
        for link in sorted({found["link"] for found in singles}, key=_order):
            rows.append(_of_body(skin, link, [found for found in singles if found["link"] == link], rate))
    return rows


def _order(link: str) -> tuple[bool, str]:
    return link == "hand", link


def _of_body(skin: str, link: str, found: list[Row], rate: float) -> Row:
    row: Row = {"skin": skin, "link": link, "contacts": len(found)}
    for when in ("", "_end"):
        detected = [one for one in found if one[f"detected{when}"]]
        row |= {
            f"detected{when}": len(detected),
            f"right_link{when}": rounded(sum(one[f"right{when}"] for one in found) / len(found), 4),
            f"median_error{when}_m": _at([one[f"error{when}_m"] for one in detected], 50),
            f"p90_error{when}_m": _at([one[f"error{when}_m"] for one in detected], 90),
            f"median_sigma{when}_m": _at([one[f"sigma{when}_m"] for one in detected], 50),
        }
    taken = [one["taken_for"] for one in found if one["detected"] and not one["right"]]
    row["taken_for"] = {name: taken.count(name) for name in sorted(set(taken), key=_order)}
    return row | {"median_limit_m": _at([one["limit_m"] for one in found], 50), "rate_hz": rate}


def _at(values: list[float], percent: float) -> float | None:
    return rounded(float(np.percentile(values, percent)), 4) if values else None


def tables_of(results: Row) -> list[TextTable]:
    """Return the tables of what the JSON file holds."""
    judged = scenario("localization")["judged"]
    rows = results["rows"]
    rates = ", ".join(f"{skin} {rate:.0f} Hz" for skin, rate in {r["skin"]: r["rate_hz"] for r in rows}.items())
    return [
        tabulated(
            "Where a contact is said to be",
            _SINGLES,
            rows,
            f"Judged {1000 * judged['after_s']:.0f} ms after the force began to rise, or at its end if that is earlier,"
            " and once more at its end. Error: from the true place, both on the body in that posture, of what was"
            " detected, whichever body it was taken for; what was not detected is not right. hand: link 7, flange and"
            " hand, which the same joints move. Limit: what the torques alone could tell at best, the bound of Cramer"
            " and Rao, median."
            f" An inference takes so long that 99 of 100 would keep up with: {rates}.",
        )
    ]


def _percent(key: str) -> Callable[[Row], str]:
    return lambda row: f"{100 * row[key]:.0f} %"


def _cm(key: str) -> Callable[[Row], str]:
    return lambda row: "-" if row[key] is None else f"{100 * row[key]:.1f}"


def _taken_for(row: Row) -> str:
    return ", ".join(f"{name} {count}" for name, count in row["taken_for"].items()) or "-"


_SINGLES = (
    ("skin", plain("skin")),
    ("body", plain("link")),
    ("contacts", plain("contacts")),
    ("detected", plain("detected")),
    ("right\nbody", _percent("right_link")),
    ("taken for", _taken_for),
    ("median\n[cm]", _cm("median_error_m")),
    ("90 %\n[cm]", _cm("p90_error_m")),
    ("limit\n[cm]", _cm("median_limit_m")),
    ("right\nat end", _percent("right_link_end")),
    ("median\nat end [cm]", _cm("median_error_end_m")),
)
