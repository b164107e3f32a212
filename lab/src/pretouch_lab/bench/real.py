"""Contact detectors on public recordings of real arms: false alarms, contacts, delays, links.

Each detector plays each set with its halves crosswise: one half learns, the other is judged.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from pretouch.errors import RecordingError
from pretouch.imported_data.detect import MOVING_RAD_S, detect
from pretouch.profiles import Profile, profile
from pretouch.recording.compare import DetectedContact
from pretouch.text_table import TextTable
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.bench.real_sets import SETS, Run, Stream, corrected, model_of, stream_of
from pretouch_lab.run import Cell, Row
from pretouch_lab.table import Column, rate_bounds, table

DETECTORS = ("fixed", "observer", "paper", "pretouch")
_AFTER_S = 0.1
"""Time after a contact in which an alarm still counts as found, and none as false [s]."""
_NEAR_S = 0.5
"""Contacts that part for less are one: so long nothing is a new alarm either [s]."""


def halves(count: int) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """Return pairs of runs to learn from and runs to be judged, no run in both; each of them is judged once."""
    even, odd = tuple(range(0, count, 2)), tuple(range(1, count, 2))
    return (even, odd), (odd, even)


def trial(folder: Path, cell: Cell, _seed: int) -> Row:
    """Play a detector on a set: what a row of each table says that the set has something for."""
    runs, whole = _prepared(folder, cell["set"])
    counts: dict[str, Tally] = {}
    for learn, judge in halves(len(runs)):
        # what is learnt in the first half by a detector that does so is kept, as from one session to the next
        stream = corrected(whole, learn).only((*learn, *judge))
        said = said_of(stream, profile(cell["detector"]))
        for name in TABLES:
            judged = tuple(number for number in judge if runs[number].touched is (name == "contacts"))
            if judged:
                counts[name] = counts.get(name, Tally()) + tally(stream, said, judged, [run.joints for run in runs])
    return {name: count.row() for name, count in counts.items()}


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


@dataclass(frozen=True)
class Said:
    """What a detector said in S cycles."""

    alarms: tuple[DetectedContact, ...]
    time: FloatArray
    """(S,) [s]."""
    armed: BoolArray
    """(S,)."""


def said_of(stream: Stream, profile: Profile) -> Said:
    """Let a detector run over a stream, as `pretouch detect` does."""
    try:
        result, course = detect(stream.recording, profile)
    except RecordingError:  # too short for its window
        return Said((), np.zeros(0), np.zeros(0, np.bool_))
    return Said(result.contacts, course.time, course.judged)


@dataclass(frozen=True)
class Tally:
    """Counts that add up over runs."""

    motion_s: float = 0.0
    """Free motion in which a contact could be detected [s]."""
    false_alarms: int = 0
    found: int = 0
    busy: int = 0
    """Contacts that began during an alarm of before: neither found nor missed."""
    contacts: int = 0
    delays_s: tuple[float, ...] = ()
    links_right: int = 0
    links_said: int = 0
    """Contacts found on a link that the set names, by a detector that names one."""

    def __add__(self, other: "Tally") -> "Tally":
        return Tally(*(getattr(self, name) + getattr(other, name) for name in self.__dataclass_fields__))

    def row(self) -> Row:
        """Return what a table shows."""
        hours = self.motion_s / 3600.0
        low, high = rate_bounds(self.false_alarms, hours) if hours else (None, None)
        return {
            "motion_s": self.motion_s, "false_alarms": self.false_alarms,
            "per_hour": self.false_alarms / hours if hours else None,
            "per_hour_low": low, "per_hour_high": high,
            "found": self.found, "busy": self.busy, "contacts": self.contacts,
            "median_delay_ms": 1000.0 * float(np.median(self.delays_s)) if self.delays_s else None,
            "link_right": self.links_right if self.links_said else None, "link_said": self.links_said,
        }  # fmt: skip


def tally(stream: Stream, said: Said, judged: Sequence[int], joints: Sequence[tuple[int, ...]]) -> Tally:
    """Count over some runs of a stream; `joints` names the touched link of each run of the set, as `Run` does."""
    r, own = stream.recording, np.isin(stream.run, judged)
    spans = [span for span in _spans(stream) if own[span[0]]]
    from_to = [(r.time[first], r.time[last] + _AFTER_S) for first, _, last in spans]
    at = np.searchsorted(r.time, said.time, side="right") - 1
    free = own[at] & said.armed & (np.abs(r.qd_commanded[at]).max(axis=1) > MOVING_RAD_S)
    for begin, end in from_to:
        free &= (said.time < begin) | (said.time > end)
    count = Tally(
        motion_s=float(free.sum() * np.median(np.diff(said.time))) if free.any() else 0.0,
        false_alarms=int(free[np.searchsorted(said.time, [alarm.time_s for alarm in said.alarms])].sum()),
    )
    for (first, touch, _), (begin, end) in zip(spans, from_to, strict=True):
        if touch >= 0:
            count += _contact(said, (begin, r.time[touch], end), stream, joints[stream.run[first]])
    return count


def _contact(said: Said, times: tuple[float, float, float], stream: Stream, joints: tuple[int, ...]) -> Tally:
    begin, touch, end = times
    alarm = next((alarm for alarm in said.alarms if begin <= alarm.time_s <= end), None)
    if alarm is None:
        busy = any(alarm.time_s < begin <= (alarm.end_s or alarm.time_s) for alarm in said.alarms)
        return Tally(busy=int(busy), contacts=int(not busy))
    model, link = stream.recording.model, alarm.link if joints else None
    named = link is not None
    right = link is not None and int(model.moved_by[model.link_index(link)].sum()) in joints
    return Tally(
        found=1, contacts=1, delays_s=(alarm.time_s - touch,), links_right=int(right), links_said=int(named)
    )  # fmt: skip


def _spans(stream: Stream) -> list[tuple[int, int, int]]:
    """Stretches that are not sure to be free: first sample, first in a contact (-1: none), last sample."""
    label, time, run = stream.label, stream.recording.time, stream.run
    found: list[tuple[int, int, int]] = []
    some = np.flatnonzero(label)
    if not len(some):
        return found
    apart = (np.diff(time[some]) > _NEAR_S) | (np.diff(run[some]) != 0)
    for part in np.split(some, np.flatnonzero(apart) + 1):
        touch = part[label[part] == 1]
        found.append((int(part[0]), int(touch[0]) if len(touch) else -1, int(part[-1])))
    return found


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


def tables(rows: Sequence[Row]) -> list[TextTable]:
    """Write the rows, a table for each kind."""
    made = []
    for name, (title, columns, note) in TABLES.items():
        some = [{"set": row["set"], "detector": row["detector"], **row[name]} for row in rows if name in row]
        if some:
            made.append(table(title, columns, some, note, 2))
    return made


TABLES = {
    "free": (
        "Real free motion",
        _COMMON,
        "False alarms an hour of free motion, with exact 95 % bounds (Poisson).",
    ),
    "contacts": (
        "Real contacts",
        (*_COMMON, *_CONTACTS),
        "Found of the labelled contacts; busy: began during an earlier alarm, and count in neither. Link: right of"
        " those that set and detector name.",
    ),
}
