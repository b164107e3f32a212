import json
from types import SimpleNamespace

import numpy as np
import pytest
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.types import Mode
from pretouch_lab.cell import Cell
from pretouch_lab.trial import Record
from pretouch_lab.weaknesses import endless

WHERE = {"trajectory": "line", "side": "-y", "stiffness_n_per_m": 25e3, "restrictions": "off"}


def course(*touches, duration=30.0):
    """Time [s] and true force [N], 1 kHz, with touches given as (from, to, force)."""
    time = np.arange(round(1000 * duration)) / 1000
    force = np.zeros((len(time), 3))
    for start, end, size in touches:
        force[(time >= start) & (time < end), 1] = size
    return time, force


def record(detected, *touches):
    time, force = course(*touches)
    steps = [SimpleNamespace(stamp=t, contact="contact", mode=Mode.REACT) for t in detected]
    return Record(steps, time, force, [], np.full((len(steps), 3), np.nan))


def test_touches_less_than_a_fifth_of_a_second_apart_are_one_contact():
    time, force = course((1.0, 1.1, 5.0), (1.25, 1.3, 5.0), (1.6, 1.7, 5.0), (2.0, 2.5, 0.9))
    found = endless.contacts(time, np.linalg.norm(force, axis=1))
    assert [(time[a], time[b]) for a, b in found] == [(1.0, 1.299), (1.6, 1.699)]
    assert endless.contacts(time, np.zeros(len(time))) == []


def test_results_count_contacts_detections_and_peaks_and_without_a_contact_there_are_none():
    touches = (2.0, 2.1, 40.0), (6.0, 6.1, 60.0), (11.0, 11.1, 30.0)
    measured = {"contacts": 3, "detections": 3, "interval_s": 4.5, "touching_fraction": 0.01, "ended": True}
    measured |= {"first_peak_n": 40.0, "last_peak_n": 30.0, "highest_peak_n": 60.0, "held": False}
    assert endless.results(record([2.05, 6.05, 11.05], *touches)) == measured
    assert endless.results(record([2.05], *touches, (25.0, 25.1, 30.0)))["ended"] is False
    row = endless.results(record([]))
    assert (row["contacts"], row["detections"], row["ended"]) == (0, 0, False)
    assert row["interval_s"] is row["first_peak_n"] is row["last_peak_n"] is row["highest_peak_n"] is None


def test_the_first_detection_does_not_end_a_trial_and_reactions_are_as_far_apart_as_they_last(
    context, panda_model, monkeypatch
):
    monkeypatch.setattr(endless, "_DURATION_S", 30.0)
    row, rec = endless.trial(Cell(endless.NAME, "paper", WHERE), 100, context)
    assert rec.steps[-1].stamp == pytest.approx(30.0, abs=0.02)
    assert row["detections"] == len(rec.reactions())
    assert row["contacts"] > 1
    assert row["ended"] is False
    json.dumps(row, allow_nan=False)
    assert_within_limits(rec, panda_model)
    assert np.diff([s.stamp for s in rec.reactions()]).min() >= 2.0
    assert row["interval_s"] >= 2.0


def row(seed, profile="paper", **changes):
    return {
        "experiment": "endless", **WHERE, "profile": profile, "seed": seed, "contacts": 10, "detections": 10,
        "interval_s": 5.0, "first_peak_n": 30.0, "last_peak_n": 20.0, "highest_peak_n": 31.0,
        "touching_fraction": 0.02, "ended": False, "held": False,
    } | changes  # fmt: skip


def test_a_summary_is_made_of_whatever_rows_there_are():
    never = row(1, contacts=0, interval_s=None, first_peak_n=None, last_peak_n=None, highest_peak_n=None)
    summary = endless.summarise([row(0), never, row(2, contacts=4, ended=True), row(0, "blind")])
    paper, blind = summary["cells"]
    assert (paper["trials"], paper["ended"], blind["trials"]) == (3, 1, 1)
    assert paper["contacts"]["median"] == 4
    assert paper["first_peak_n"]["n"] == 2
    (table,) = endless.tables(summary)
    assert table.rows[0] == ("line -y", "paper", "off", "25", "4", "10", "5.00", "30.0", "20.0", "2", "1/3")
    assert width(table) <= 80
