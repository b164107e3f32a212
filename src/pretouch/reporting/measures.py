"""One recording, measured: what the sections of a report are written from."""

from dataclasses import dataclass

from pretouch.recording.reader import Recorded
from pretouch.reporting.contacts import ContactMeasures, contacts_in
from pretouch.reporting.motion import limit_rows
from pretouch.reporting.record import RunCourse, gather


@dataclass(frozen=True)
class Measures:
    """One recording, measured."""

    title: str
    """Name of the file, with as much of its folder as tells it from the others."""
    lacking: str
    """Sentence on the missing part of an incomplete file, or ''."""
    course: RunCourse
    contacts: ContactMeasures
    exceeded: list[str]
    """Limits of the arm that were exceeded, as "velocity of joint 2"."""


def measure(recorded: Recorded, title: str) -> Measures:
    """Measure a recording."""
    course = gather(recorded)
    lacking = "" if recorded.complete else recorded.sentence or "The file is not complete."
    return Measures(title, lacking, course, contacts_in(course), limit_rows(course)[1])
