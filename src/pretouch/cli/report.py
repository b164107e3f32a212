"""`pretouch report`: one page on a recording."""

from dataclasses import dataclass
from pathlib import Path

import tyro

from pretouch.cli.writing import check_outputs, unwritable_said
from pretouch.extras import FIGURES


@dataclass(frozen=True)
class WriteReport:
    """Write a report of a recording as one page that needs no network: contacts, forces, distances, margins, health."""

    file: tyro.conf.Positional[Path]
    """Recording; that of a killed process works too."""
    out: Path = Path("report.html")
    """File to write."""
    replace: bool = False
    """Overwrite an existing file."""

    def run(self) -> None:
        """Write the page."""
        FIGURES.need("A report")
        check_outputs([("report", self.out)], [self.file], self.replace)
        from pretouch.recording.reader import open_recording  # a help does not wait for this
        from pretouch.reporting.measures import measure
        from pretouch.reporting.page import page  # needs the extra

        text = page(measure(open_recording(self.file), self.file.name))
        with unwritable_said("report", self.out):
            self.out.write_text(text, encoding="utf-8", errors="replace")  # a file name may be no text
        print(f"Report: {self.out}")
