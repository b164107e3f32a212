"""The record of one trial as arrays: what figures are drawn from."""

from pathlib import Path

from pretouch.recording.reader import open_recording
from pretouch.recording.run_record import RunRecord, TrueForces, columns_of, contacts_of
from pretouch_lab.trial import Record, record_of


def trace_of(record: Record) -> RunRecord:
    """Return what a trial left behind as arrays."""
    truth, contacts = TrueForces(record.true_time, record.true_force), tuple(contacts_of(record.steps))
    return RunRecord(**columns_of(record.steps), contacts=contacts, truth=truth)


def read_trace(place: Path) -> tuple[RunRecord, tuple[str, ...]]:
    """Read a recorded trial, and the names of its units; RecordingError for what is no recording."""
    recorded = open_recording(place)
    return trace_of(record_of(recorded)), recorded.runs[0].skin.ids
