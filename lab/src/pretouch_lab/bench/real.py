"""Contact detectors on public recordings of real arms: false alarms, contacts, delays, links.

Each detector plays each set twice: it learns in one half of the runs and is tested in the other, then the halves swap.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from pretouch.imported_data.detect import MOVING_RAD_S, detect
from pretouch.imported_data.results import Course
from pretouch.profiles import profile
from pretouch.recording.compare import DetectedContact
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.text_table import TextTable
from pretouch_lab.bench.real_sets import SETS, RealRun, TorqueStream, corrected, stream_of
from pretouch_lab.run import Cell, Row
from pretouch_lab.table import Column, rate_bounds, table

_AFTER_S = 0.1
"""Time after a contact in which an alarm still belongs to it, and none is false [s]."""
_NEAR_S = 0.5
"""Shortest break between two contacts [s]; alarms within it are no new alarms either."""


def halves(count: int) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """Return pairs of runs to learn from and runs to test, disjoint; each run is tested once."""
    even, odd = tuple(range(0, count, 2)), tuple(range(1, count, 2))
    return (even, odd), (odd, even)


def trial(folder: Path, cell: Cell, _seed: int) -> Row:
    """Play a detector on a set; return the values of each table that the set has runs for."""
    runs, whole = _prepared(folder, cell["set"])
    counts: dict[str, list[Row]] = {name: [] for name in TABLES}
    for learn, judge in halves(len(runs)):
        # a learning detector keeps the state of the first half, as from one session to the next
        stream = corrected(whole, learn).only((*learn, *judge))
        result, course = detect(stream.recording, profile(cell["detector"]))
        for name, some in counts.items():
            numbers = [number for number in judge if runs[number].touched is (name == "contacts")]
            if numbers:
                some.append(tally(stream, result.contacts, course, numbers, [run.joints for run in runs]))
    return {name: total(some) for name, some in counts.items() if some}


@lru_cache(maxsize=1)
def _prepared(folder: Path, name: str) -> tuple[list[RealRun], TorqueStream]:
    real = next(each for each in SETS if each.name == name)
    runs = parted(real.read(real.files(folder)))
    return runs, stream_of(real, runs, RobotModel(robot_named(real.arm_of(folder))))


def parted(runs: list[RealRun]) -> list[RealRun]:
    """Cut a single recording in the middle, so that there are two halves."""
    if len(runs) > 1:
        return runs
    (r,), middle = runs, len(runs[0].time) // 2
    parts = (slice(middle), slice(middle, None))
    return [RealRun(r.time[part], r.q[part], r.qd[part], r.torque[part], r.label[part], r.joints) for part in parts]


def tally(
    stream: TorqueStream,
    alarms: Sequence[DetectedContact],
    course: Course,
    runs: Sequence[int],
    joints: Sequence[tuple[int, ...]],
) -> Row:
    """Count alarms and contacts in some runs of a stream, for `total`; `joints` are those of each run, see `RealRun`.

    A contact is `busy` if it began during an earlier alarm: it is neither found nor missed. Links count if the set
    names the touched link and the detector names one.
    """
    r, model, own = stream.recording, stream.recording.model, np.isin(stream.run, runs)
    at = np.searchsorted(r.time, course.time, side="right") - 1
    free = own[at] & course.judged & (np.abs(r.qd_commanded[at]).max(axis=1) > MOVING_RAD_S)
    delays_s: list[float] = []
    busy = missed = right = named = 0
    for first, touch, last in _spans(stream):
        begin, end = r.time[first], r.time[last] + _AFTER_S
        free &= (course.time < begin) | (course.time > end)
        if touch < 0 or not own[first]:
            continue
        alarm = next((alarm for alarm in alarms if begin <= alarm.time_s <= end), None)
        if alarm is None:
            during = any(alarm.time_s < begin <= (alarm.end_s or alarm.time_s) for alarm in alarms)
            busy, missed = busy + during, missed + (not during)
            continue
        delays_s.append(alarm.time_s - r.time[touch])
        if alarm.link and joints[stream.run[first]]:
            named += 1
            right += int(model.moved_by[model.link_index(alarm.link)].sum()) in joints[stream.run[first]]
    return {
        "motion_s": float(free.sum() * np.median(np.diff(course.time))),
        "false_alarms": int(free[np.searchsorted(course.time, [alarm.time_s for alarm in alarms])].sum()),
        "found": len(delays_s),
        "busy": busy,
        "contacts": len(delays_s) + missed,
        "delays_s": delays_s,
        "link_right": right,
        "link_said": named,
    }


def total(counts: Sequence[Row]) -> Row:
    """Add up counts; add the rate of false alarms, its bounds and the median delay, or None."""
    row: Row = {name: sum((count[name] for count in counts), start=type(counts[0][name])()) for name in counts[0]}
    hours, delays_s = row["motion_s"] / 3600.0, row.pop("delays_s")
    low, high = rate_bounds(row["false_alarms"], hours) if hours else (None, None)
    return row | {
        "per_hour": row["false_alarms"] / hours if hours else None,
        "per_hour_low": low,
        "per_hour_high": high,
        "median_delay_ms": 1000.0 * float(np.median(delays_s)) if delays_s else None,
        "link_right": row["link_right"] if row["link_said"] else None,
    }


def _spans(stream: TorqueStream) -> list[tuple[int, int, int]]:
    """Return spans that are not certainly free: first sample, first sample in a contact or -1, last sample."""
    label, time, run = stream.label, stream.recording.time, stream.run
    some = np.flatnonzero(label)
    apart = (np.diff(time[some]) > _NEAR_S) | (np.diff(run[some]) != 0)
    parts = np.split(some, np.flatnonzero(apart) + 1) if len(some) else []
    return [(int(part[0]), int(next(iter(part[label[part] == 1]), -1)), int(part[-1])) for part in parts]


_COMMON = (
    Column("set", "set"),
    Column("detector", "detector"),
    Column("free motion [s]", "motion_s", 0),
    Column("false alarms", "false_alarms"),
    Column("an hour", "per_hour", 0),
    Column("95 % from", "per_hour_low", 0),
    Column("to", "per_hour_high", 0),
)
_CONTACTS = (
    Column("found", "found", of="contacts"),
    Column("busy", "busy"),
    Column("delay, median [ms]", "median_delay_ms", 0),
    Column("link right", "link_right", of="link_said"),
)
TABLES = {
    "free": (
        "Real free motion",
        _COMMON,
        "False alarms an hour of free motion, with exact 95 % bounds (Poisson).",
    ),
    "contacts": (
        "Real contacts",
        (*_COMMON, *_CONTACTS),
        "Found: of the labelled contacts. Busy: contacts that began during an earlier alarm; they do not count as found"
        " or missed. Link right: of the links that both set and detector name.",
    ),
}


def tables(rows: Sequence[Row]) -> list[TextTable]:
    """Return a table of the rows for free motion, and one for contacts."""
    parts = {name: [{**row, **row[name]} for row in rows if name in row] for name in TABLES}
    return [
        table(title, columns, parts[name], note, 2) for name, (title, columns, note) in TABLES.items() if parts[name]
    ]
