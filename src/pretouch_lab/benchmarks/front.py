"""The one table that says why, for the first page: blind, paper and pretouch, from the numbers of both benchmarks."""

from collections.abc import Callable

from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.bounds import short
from pretouch_lab.benchmarks.goals import find
from pretouch_lab.rows import Row

_SHOWN = {"blind": "blind", "paper": "paper", "paper-off": "paper", "pretouch": "pretouch"}
"""Baselines of the closed loop, and the detector of each."""


def front_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the table; what a detector has not is a dash."""
    cells = {(cell["family"], cell["contender"]): cell for cell in avoidance["families"]}
    shown = [name for name in _SHOWN if ("static", name) in cells and ("person", name) in cells]

    def free(name: str) -> str:
        row = find(detection["rows"], _SHOWN[name], "free: goal")
        return "-" if row is None else short(row["false_alarms_per_hour"])

    def delay(seen: bool) -> Callable[[str], str]:
        return lambda name: _delay(find(detection["rows"], _SHOWN[name], "contacts: goal", seen))

    def of(family: str, key: str) -> Callable[[str], str]:
        return lambda name: _value(cells[family, name], key, 1)

    columns = (
        ("", str),
        ("false alarms\n[1/h]", free),
        ("delay, seen\n[ms]", delay(True)),
        ("delay, unseen\n[ms]", delay(False)),
        ("peak, estimated\n[N]", of("static", "peak_estimate_n")),
        ("true 20 ms\n[N]", of("static", "true_peak_20ms_n")),
        ("until touch\n[s]", of("static", "first_contact_s")),
        ("turn beside\na person [s]", of("person", "cycle_time_s")),
    )
    return tabulated(
        "Blind, paper and pretouch",
        columns,
        shown,
        "Medians. Delay: of contacts of 15 N and more for 100 ms and more, in brackets those missed. Forces and time"
        " until the touch: at a board of 25 N/mm, a dash if never touched. paper has its restrictions, paper-off has"
        " none. > is a turn that did not end.",
        1,
    )


def _delay(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    delay = "none" if row["median_delay_s"] is None else f"{1000 * row['median_delay_s']:.0f}"
    return f"{delay} ({row['missed']}/{row['contacts']})"


def _value(cell: Row, key: str, digits: int) -> str:
    spread = cell[key]
    if spread is None:
        return "-"
    return ">" if spread["median"] is None else f"{spread['median']:.{digits}f}"
