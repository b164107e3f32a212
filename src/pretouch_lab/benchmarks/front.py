"""The one table that says why, for the first page: blind, paper and pretouch, from the numbers of both benchmarks."""

from pretouch.text_table import TextTable
from pretouch_lab.benchmarks.bounds import short
from pretouch_lab.benchmarks.goals import find
from pretouch_lab.rows import Row

_SHOWN = {"blind": "blind", "paper": "paper", "paper-off": "paper", "pretouch": "pretouch"}
"""Contenders of the closed loop, and the detector of each."""


def front_table(detection: Row, avoidance: Row) -> TextTable:
    """Return the table; what a detector has not is a dash."""
    cells = {(cell["family"], cell["contender"]): cell for cell in avoidance["families"]}
    lines = []
    for name, detector in _SHOWN.items():
        board, person = cells.get(("static", name)), cells.get(("person", name))
        if board is None or person is None:
            continue
        free = find(detection["rows"], detector, "free: goal")
        felt = [find(detection["rows"], detector, "contacts: goal", seen) for seen in (True, False)]
        lines.append((
            name, "-" if free is None else short(free["false_alarms_per_hour"]), *map(_felt, felt),
            *(_value(board, key, digits) for key, digits in
              (("peak_estimate_n", 1), ("true_peak_20ms_n", 1), ("first_contact_s", 1))),
            _value(person, "cycle_time_s", 1),
        ))  # fmt: skip
    return TextTable(
        "Blind, paper and pretouch",
        ("", "false alarms\n[1/h]", "delay, seen\n[ms]", "delay, unseen\n[ms]", "peak felt\n[N]", "true 20 ms\n[N]",
         "until touch\n[s]", "turn beside\na person [s]"),
        tuple(lines),
        "Medians. Delay: of contacts of 15 N and more for 100 ms and more, in brackets those missed. Forces and time"
        " until the touch: at a board of 25 N/mm, a dash if never touched. paper has its restrictions, paper-off has"
        " none. > is a turn that did not end.", 1,
    )  # fmt: skip


def _felt(row: Row | None) -> str:
    if row is None or not row["contacts"]:
        return "-"
    delay = "none" if row["median_delay_s"] is None else f"{1000 * row['median_delay_s']:.0f}"
    return f"{delay} ({row['missed']}/{row['contacts']})"


def _value(cell: Row, key: str, digits: int) -> str:
    spread = cell[key]
    if spread is None:
        return "-"
    return ">" if spread["median"] is None else f"{spread['median']:.{digits}f}"
