"""The one table that says why, for the first page: blind, paper and pretouch, from the numbers of both benchmarks."""

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.goals import find
from pretouch_lab.run import Row
from pretouch_lab.table import short

_SHOWN = ("blind", "paper", "pretouch")
"""Baselines of the closed loop, and detectors of the same names."""

_NOTE = (
    "Simulated, medians. The board has 25 N/mm, and units see it; its force is the highest for 20 ms. Pushes: the"
    " contacts of the goals, of 15 N and more for 100 ms and more on the links 3 to 7 and the hand, whose torques"
    " exceed three standard deviations of free motion's, on the usual arm with 32 units; seen by these or not. All"
    " kinds: every contact of the benchmark, on all links, from 5 N and 30 ms on, of other arms and with impaired units"
    " too. Left out are contacts that came while a false alarm was being answered. Nobody near: in an empty room. A"
    " turn that did not end is >."
)


def front_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the table; what was not measured is a dash."""
    cells = {(cell["family"], cell["contender"]): cell for cell in avoidance["families"]}
    shown = [name for name in _SHOWN if ("static", name) in cells and ("person", name) in cells]

    def contacts(name: str, which: str = "goal") -> list[Row]:
        rows = (find(detection["rows"], name, f"contacts: {which}", seen) for seen in (True, False))
        return [row for row in rows if row is not None]

    def delay(name: str) -> str:
        delays = [row["median_delay_s"] for row in contacts(name)]
        return " / ".join("none" if delay is None else f"{1000 * delay:.0f} ms" for delay in delays) or "-"

    def missed(rows: list[Row]) -> str:
        return f"{sum(row['missed'] for row in rows)} of {sum(row['contacts'] for row in rows)}" if rows else "-"

    def force(name: str) -> str:
        cell = cells["static", name]
        return "keeps away" if cell["first_contact_s"] is None else f"{_value(cell, 'true_peak_20ms_n')} N"

    def turn(name: str) -> str:
        return f"{_value(cells['person', name], 'cycle_time_s')} s"

    def alarms(name: str, near: str) -> str:
        row = find(detection["rows"], name, f"free: goal, {near}")
        return "-" if row is None else short(row["false_alarms_per_hour"])

    columns = (
        ("", str),
        ("force on a board\nin its way", force),
        ("a push is noticed after\n(seen / not seen)", delay),
        ("pushes not\nnoticed", lambda name: missed(contacts(name))),
        ("contacts of all\nkinds not noticed", lambda name: missed(contacts(name, "all"))),
        ("a turn beside\na person", turn),
        ("false alarms an hour,\nnobody near", lambda name: alarms(name, "nobody near")),
        ("the same, somebody\nstands near", lambda name: alarms(name, "somebody standing")),
    )
    return tabulated(
        "What happens when it touches something",
        columns,
        shown,
        _NOTE,
        1,
    )


def _value(cell: Row, key: str) -> str:
    spread = cell[key]
    if spread is None:
        return "-"
    return ">" if spread["median"] is None else f"{spread['median']:.1f}"
