"""`pretouch bench real`: each detector on each set, halves crosswise: one half learns, the other is judged."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from pretouch.profiles import profile
from pretouch.text_table import TextTable, tabulated
from pretouch_lab.benchmarks.real.external import Stream, corrected, model_of, stream_of
from pretouch_lab.benchmarks.real.judge import Tally, said_of, tally
from pretouch_lab.benchmarks.real.sets import SETS, Run
from pretouch_lab.run import Row

DETECTORS = ("fixed", "observer", "paper", "pretouch")
TABLES = {
    "free": "Real free motion",
    "contacts": "Real contacts",
}
_NOTES = {
    "free": "False alarms an hour of free motion, with exact 95 % bounds (Poisson).",
    "contacts": (
        "Found of the labelled contacts; busy: began during an earlier alarm, and count in neither. Link: right of"
        " those that set and detector name."
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Work:
    """A detector on a set."""

    folder: Path
    set_name: str
    detector: str


def halves(count: int) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """Return pairs of runs to learn from and runs to be judged, no run in both; each of them is judged once."""
    even, odd = tuple(range(0, count, 2)), tuple(range(1, count, 2))
    return (even, odd), (odd, even)


def play(work: Work) -> list[Row]:
    """Return a row for each table that a set has something for."""
    runs, whole = _prepared(work.folder, work.set_name)
    counts: dict[str, Tally] = {}
    for learn, judge in halves(len(runs)):
        # what is learnt in the first half by a detector that does so is kept, as from one session to the next
        stream = corrected(whole, learn).only((*learn, *judge))
        said = said_of(stream, profile(work.detector))
        for table in TABLES:
            judged = tuple(number for number in judge if runs[number].touched is (table == "contacts"))
            if judged:
                counts[table] = counts.get(table, Tally()) + tally(stream, said, judged, [run.joints for run in runs])
    return [
        {"set": work.set_name, "table": table, "detector": work.detector, **counts[table].row()}
        for table in TABLES if table in counts
    ]  # fmt: skip


@lru_cache(maxsize=1)
def _prepared(folder: Path, name: str) -> tuple[list[Run], Stream]:
    real = next(each for each in SETS if each.name == name)
    runs, model = parted(real.read(real.files(folder))), model_of(real, folder)
    return runs, stream_of(real, runs, model)


def parted(runs: list[Run]) -> list[Run]:
    """Cut a single recording in the middle, so that there are two: nothing else could be judged apart."""
    if len(runs) > 1:
        return runs
    (r,), middle = runs, len(runs[0].time) // 2
    return [
        Run(f"{r.name}, {half} half", r.time[part], r.q[part], r.qd[part], r.torque[part], r.label[part], r.joints)
        for half, part in (("first", slice(middle)), ("second", slice(middle, None)))
    ]


def tables_of(rows: Sequence[Row]) -> list[TextTable]:
    """Write the rows, a table for each kind."""
    return [
        tabulated(title, [*_COMMON, *([] if table == "free" else _FOUND)], some, _NOTES[table])
        for table, title in TABLES.items() if (some := [row for row in rows if row["table"] == table])
    ]  # fmt: skip


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f}"


_COMMON = (
    ("set", lambda row: row["set"]), ("detector", lambda row: row["detector"]),
    ("free motion [s]", lambda row: _number(row["motion_s"])), ("false alarms", lambda row: str(row["false_alarms"])),
    ("an hour", lambda row: _number(row["per_hour"])),
    ("95 %", lambda row: f"{_number(row['per_hour_low'])} to {_number(row['per_hour_high'])}"),
)  # fmt: skip
_FOUND = (
    ("found", lambda row: f"{row['found']} of {row['contacts']}"), ("busy", lambda row: str(row["busy"])),
    ("delay, median [ms]", lambda row: _number(row["median_delay_ms"])),
    ("link right", lambda row: f"{row['link_right']} of {row['link_said']}" if row["link_said"] else "–"),
)  # fmt: skip
