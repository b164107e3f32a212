"""Contact detectors on public recordings of real arms: delay, misses and false alarms an hour in one table.

Each detector plays each set twice: it learns in one half of the runs and is tested in the other, then the halves swap.
False alarms are counted on the recordings as they are, delays and misses on the same recordings with added pushes.
"""

import json
import sys
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from pretouch.profiles import profile
from pretouch.robot.description import robot_named
from pretouch.robot.model import RobotModel
from pretouch.text_table import TextTable, markdown
from pretouch.types import BoolArray, FloatArray
from pretouch_lab.baselines.window_network import learnt
from pretouch_lab.bench.players import Alarms, Method, by_profile, five_sigma, free_torques
from pretouch_lab.bench.pushes import LASTING_S, RealPushes, in_any_direction, pushed, starts, told_least
from pretouch_lab.bench.real_sets import SETS, RealRun, TorqueStream, corrected, stream_of
from pretouch_lab.run import Cell, Row
from pretouch_lab.table import Column, grouped, rate_bounds, rounded, table

METHODS: dict[str, Method] = {"five-sigma": five_sigma, "learnt": learnt}
"""Detectors that learn from the other half of the runs, by name."""
FORCES_N = (15, 30)
"""Forces of the pushes [N]."""
_EVERY_S = 4.0
"""Time between two pushes [s]: they are so rare that they hardly change what a detector learns."""
_PHASES = 4
"""Number of plays with pushes of a force, each with its own instants and directions."""
_AFTER_S = 0.1
"""Time after a push or a contact in which an alarm still belongs to it, and none is false [s]."""
_NEAR_S = 0.5
"""Shortest break between two contacts, or between two alarms [s]."""
_AGAIN_S = 2.0
"""Duration of an alarm after which it counts as another one [s]: that of the paper's reaction."""
_STALE_S = 0.1
"""Age of the newest sample from which a cycle is in no run [s]."""


def check(detectors: Sequence[str]) -> None:
    """Raise ParameterError for a name that is neither a method nor a profile."""
    for name in detectors:
        if name not in METHODS:
            profile(name)


def halves(count: int) -> tuple[tuple[tuple[int, ...], tuple[int, ...]], ...]:
    """Return pairs of runs to learn from and runs to test, disjoint; each run is tested once."""
    even, odd = tuple(range(0, count, 2)), tuple(range(1, count, 2))
    return (even, odd), (odd, even)


def trial(folder: Path, cell: Cell, _seed: int) -> Row:
    """Play a detector on a set; return counts, and delays in milliseconds."""
    runs, whole = _prepared(folder, cell["set"])
    joints = [run.joints for run in runs]
    return total([_half(whole, joints, *half, cell["detector"]) for half in halves(len(runs))])


@lru_cache(maxsize=1)
def _prepared(folder: Path, name: str) -> tuple[list[RealRun], TorqueStream]:
    real = next(each for each in SETS if each.name == name)
    runs = parted(real.read(real.files(folder)))
    return runs, stream_of(real, runs, RobotModel(robot_named(real.arm_of(folder))))


def parted(runs: list[RealRun]) -> list[RealRun]:
    """Cut a single recording in the middle, so that there are two halves."""
    if len(runs) > 1:
        return runs
    middle = len(runs[0].time) // 2
    return [runs[0].part(slice(middle)), runs[0].part(slice(middle, None))]


def _half(
    whole: TorqueStream, joints: Sequence[tuple[int, ...]], learn: tuple[int, ...], judge: tuple[int, ...], name: str
) -> Row:
    """Fit a detector on some runs, and count what it does on the others."""
    # a detector that learns online keeps the state of the first half, as from one session to the next
    own = corrected(whole, learn)
    stream, earlier = own.only((*learn, *judge)), own.only(learn)
    play = METHODS[name](earlier) if name in METHODS else by_profile(name)
    untouched, spread = play(stream.recording), np.cov(free_torques(earlier).T)
    counts = alarms(stream, untouched, judge) | contacts(stream, untouched, judge, joints)

    def answers(pushes: RealPushes) -> list[float | None]:
        return delays(pushes, untouched, play(pushed(stream, pushes).recording)) if len(pushes.start) else []

    for phase in range(_PHASES):
        seed = _PHASES * learn[0] + phase
        start = starts(stream, judge, _EVERY_S, seed)
        for force in FORCES_N:
            _add(counts, f"{force}n", answers(in_any_direction(start, float(force), seed)))
        stated = untouched.stated_n[np.searchsorted(untouched.time, start) - 1]
        sure = np.isfinite(stated)
        _add(counts, "stated", answers(told_least(stream, start[sure], stated[sure], spread)))
        counts["stated_n"] = [*counts.get("stated_n", []), *(rounded(force, 1) for force in stated[sure])]
    return counts


def _add(counts: Row, name: str, answers: Sequence[float | None]) -> None:
    """Add the delays [s] of pushes, None for missed ones, to counts."""
    times = [rounded(1000.0 * delay, 1) for delay in answers if delay is not None]
    counts[f"pushes_{name}"] = counts.get(f"pushes_{name}", 0) + len(answers)
    counts[f"delays_{name}_ms"] = counts.get(f"delays_{name}_ms", []) + times


def alarms(stream: TorqueStream, played: Alarms, runs: Sequence[int]) -> Row:
    """Count false alarms and the time without a contact, standing still included, in some runs."""
    time, touched = stream.recording.time, _spans(stream)
    free = np.isin(stream.run, runs)
    for first, _, last in touched:
        free &= (time < time[first]) | (time > time[last] + _AFTER_S)
    step, count = float(np.median(np.diff(time))), 0
    for begin, end in episodes(*_within(stream, played, runs)):
        if free[np.searchsorted(time, begin, side="right") - 1]:
            count += 1 + int((end - begin) / _AGAIN_S)
    return {"free_s": rounded(float(free.sum()) * step, 2), "false_alarms": count}


def _within(stream: TorqueStream, played: Alarms, runs: Sequence[int]) -> tuple[FloatArray, BoolArray]:
    """Return the cycles of some runs (S,) [s], and the flags of alarms in them."""
    time = stream.recording.time
    newest = np.maximum(np.searchsorted(time, played.time, side="right") - 1, 0)
    own = np.isin(stream.run[newest], runs) & (played.time - time[newest] < _STALE_S)
    return played.time[own], played.alarm[own]


def episodes(time: FloatArray, alarm: BoolArray) -> list[tuple[float, float]]:
    """Return begin and end [s] of each alarm, from flags at instants (S,) [s]; short breaks do not divide one."""
    at = time[alarm]
    parts = np.split(at, np.flatnonzero(np.diff(at) > _NEAR_S) + 1) if len(at) else []
    return [(float(part[0]), float(part[-1])) for part in parts]


def delays(pushes: RealPushes, untouched: Alarms, touched: Alarms) -> list[float | None]:
    """Return the delay of the first alarm after each push [s], None for a missed push.

    A push during an alarm that began before it, or that comes without any push too, is missed.
    """

    def during(played: Alarms, begin: float, end: float) -> FloatArray:
        return played.time[played.alarm & (played.time > begin) & (played.time <= end)]

    every: list[float | None] = []
    for start in pushes.start.tolist():
        end = start + LASTING_S + _AFTER_S
        busy = len(during(touched, start - _AFTER_S, start)) or len(during(untouched, start - _AFTER_S, end))
        answer = during(touched, start, end)
        every.append(None if busy or not len(answer) else float(answer[0]) - start)
    return every


def contacts(stream: TorqueStream, played: Alarms, runs: Sequence[int], joints: Sequence[tuple[int, ...]]) -> Row:
    """Count labelled contacts in some runs, those with an alarm, and the links that were named, and named rightly.

    A contact that began during an earlier alarm is missed. `joints` are those of each run, see `RealRun`.
    """
    time, model, row = stream.recording.time, stream.recording.model, dict.fromkeys(("link_named", "link_right"), 0)
    begun = [begin for begin, _ in episodes(*_within(stream, played, runs))]
    times: list[float] = []
    spans = [span for span in _spans(stream) if span[1] >= 0 and stream.run[span[0]] in runs]
    for first, touch, last in spans:
        begin, end = time[first], time[last] + _AFTER_S
        times += [rounded(1000.0 * float(at - time[touch]), 1) for at in begun if begin <= at <= end][:1]
        link = next((each.link for each in played.contacts if begin <= each.time_s <= end), None)
        if link and (allowed := joints[stream.run[first]]):
            row["link_named"] += 1
            row["link_right"] += int(model.moved_by[model.link_index(link)].sum()) in allowed
    return {"contacts": len(spans), "delays_contacts_ms": times, **row}


def _spans(stream: TorqueStream) -> list[tuple[int, int, int]]:
    """Return spans that are not certainly free: first sample, first sample in a contact or -1, last sample."""
    label, time, run = stream.label, stream.recording.time, stream.run
    some = np.flatnonzero(label)
    apart = (np.diff(time[some]) > _NEAR_S) | (np.diff(run[some]) != 0)
    parts = np.split(some, np.flatnonzero(apart) + 1) if len(some) else []
    return [(int(part[0]), int(next(iter(part[label[part] == 1]), -1)), int(part[-1])) for part in parts]


def total(counts: Sequence[Row]) -> Row:
    """Add up counts and join lists."""
    return {name: sum((count[name] for count in counts), start=type(counts[0][name])()) for name in counts[0]}


_COLUMNS = (
    Column("recordings", "set"),
    Column("detector", "detector"),
    Column("min", "minutes", 1),
    Column("false alarms an hour (95 %)", "rate"),
    Column("15 N: found", "found_15n", of="pushes_15n"),
    Column("delay: median, 90 % [ms]", "delay_15n"),
    Column("30 N: found", "found_30n", of="pushes_30n"),
    Column("says it finds [N]", "median_stated_n", 0),
    Column("finds that", "found_stated", of="pushes_stated"),
    Column("contacts: found", "found_contacts", of="contacts"),
)
NOTE = (
    "False alarms an hour of recorded time without a contact, with exact 95 % bounds (Poisson); an alarm that lasts"
    " counts again every 2 s. Pushes last 100 ms, in any direction, half of them on the end-effector and half on the"
    " end of the forearm; pushes during a false alarm are missed. Says it finds: the force that the detector itself"
    " says it finds in 95 of 100 cases in the direction that the torques tell least of, median; finds that: of pushes"
    " of that force in that direction. Contacts: of those that people made and the set labels."
)


def tables(rows: Sequence[Row]) -> list[TextTable]:
    """Return the table of rows, each detector last on all sets that have it, if these are several."""
    names = [name for name, counted in rows[0].items() if isinstance(counted, int | float | list)]
    sums = [
        {"set": "all", **key, **total([{name: row[name] for name in names} for row in own])}
        for key, own in grouped(rows, ["detector"])
        if len(own) > 1
    ]
    return [table("Contact detectors on real arms", _COLUMNS, map(_texts, [*rows, *sums]), NOTE, 2)]


def _texts(row: Row) -> Row:
    """Return the cells of a row."""
    hours = row["free_s"] / 3600.0
    low, high = rate_bounds(row["false_alarms"], hours)
    delay = row["delays_15n_ms"]
    quantiles = ", ".join(f"{value:.0f}" for value in np.percentile(delay, [50, 90])) if delay else "-"
    number = {name: len(row[f"delays_{name}_ms"]) for name in ("15n", "30n", "stated", "contacts")}
    return row | {
        "minutes": 60.0 * hours,
        "rate": f"{row['false_alarms'] / hours:.0f} ({low:.0f}-{high:.0f})",
        "delay_15n": quantiles,
        "median_stated_n": float(np.median(row["stated_n"])) if row["stated_n"] else None,
        **{f"found_{name}": count for name, count in number.items()},
        "found_stated": number["stated"] if row["pushes_stated"] else None,
        "found_contacts": number["contacts"] if row["contacts"] else None,
    }


if __name__ == "__main__":
    lines = Path(sys.argv[1]).read_text(encoding="utf-8").splitlines()
    print(markdown(tables([json.loads(line) for line in lines])[0], 2))
