"""The one table that says why, for the first page: blind, paper and pretouch, from the numbers of both benchmarks."""

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.bounds import short
from pretouch_lab.benchmarks.goals import find
from pretouch_lab.rows import Row

_SHOWN = ("blind", "paper", "pretouch")
"""Baselines of the closed loop, and detectors of the same names."""


def front_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the table; what was not measured is a dash."""
    cells = {(cell["family"], cell["contender"]): cell for cell in avoidance["families"]}
    shown = [name for name in _SHOWN if ("static", name) in cells and ("person", name) in cells]

    def pushes(name: str) -> list[Row]:
        rows = (find(detection["rows"], name, "contacts: goal", seen) for seen in (True, False))
        return [row for row in rows if row is not None]

    def delay(name: str) -> str:
        delays = [row["median_delay_s"] for row in pushes(name)]
        return " / ".join("none" if delay is None else f"{1000 * delay:.0f} ms" for delay in delays) or "-"

    def missed(name: str) -> str:
        return f"{sum(row['missed'] for row in pushes(name))} of {sum(row['contacts'] for row in pushes(name))}"

    def force(name: str) -> str:
        cell = cells["static", name]
        return "keeps away" if cell["first_contact_s"] is None else f"{_value(cell, 'true_peak_20ms_n')} N"

    def turn(name: str) -> str:
        return f"{_value(cells['person', name], 'cycle_time_s')} s"

    def free(name: str) -> str:
        row = find(detection["rows"], name, "free: goal")
        return "-" if row is None else short(row["false_alarms_per_hour"])

    columns = (
        ("", str),
        ("force on a board\nin its way", force),
        ("a push is noticed after\n(seen / not seen)", delay),
        ("pushes not\nnoticed", missed),
        ("a turn beside\na person", turn),
        ("false alarms\nan hour", free),
    )
    return tabulated(
        "What happens when it touches something",
        columns,
        shown,
        "Simulated, medians. The board has 25 N/mm; its force is the highest for 20 ms. Pushes: 15 N and more for 100"
        " ms and more, seen by the skin or not. A turn that did not end is >.",
        1,
    )


def _value(cell: Row, key: str) -> str:
    spread = cell[key]
    if spread is None:
        return "-"
    return ">" if spread["median"] is None else f"{spread['median']:.1f}"
