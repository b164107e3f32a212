"""`pretouch report`: one page on recordings."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from pretouch.cli.writing import check_outputs, unwritable_said
from pretouch.errors import RecordingError
from pretouch.extras import FIGURES


@dataclass(frozen=True)
class WriteReport:
    """Write a report of recordings as one page that needs no network: contacts, forces, distances, margins, health."""

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Recordings."""
    out: Path = Path("report.html")
    """File to write."""
    replace: bool = False
    """Overwrite an existing file."""

    def run(self) -> None:
        """Write the page."""
        if not self.files:
            raise RecordingError("No recording is given: give at least one file.")
        FIGURES.need("A report")
        check_outputs([("report", self.out)], self.files, self.replace)
        from pretouch.recording.reader import open_recording  # a help does not wait for this
        from pretouch.reporting.measures import measure
        from pretouch.reporting.page import page  # needs the extra

        names = [place.name for place in self.files]
        titles = (str(place) if names.count(place.name) > 1 else place.name for place in self.files)
        text = page(measure(open_recording(place), title) for place, title in zip(self.files, titles, strict=True))
        with unwritable_said("report", self.out):
            self.out.write_text(text, encoding="utf-8", errors="replace")  # a file name may be no text
        print(f"Report: {self.out}")
