"""What `pretouch detect` gives: sentences and tables on the terminal, numbers, and a figure or a page of all."""

from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from pretouch.atomic_write import atomic_write
from pretouch.cli.detect_words import read_from
from pretouch.cli.tables import show
from pretouch.cli.writing import unwritable_said
from pretouch.imported_data.forces import ForceRecording
from pretouch.imported_data.torques import TorqueRecording
from pretouch.text_table import TextTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ENDINGS = (".png", ".pdf", ".svg", ".html")
_DOTS_PER_INCH = 150


@dataclass(frozen=True)
class Account:
    """What is told of a recording."""

    recording: ForceRecording | TorqueRecording
    notes: list[str]
    """Sentences on what was read, and on what detectors made of it."""
    tables: list[TextTable]
    guidance: list[str]
    """Sentences on what the contacts mean."""
    figures: "Callable[[], list[tuple[Figure, str]]]"
    """Draws figures, each with what it shows."""
    numbers: dict[str, Any]
    """Of the detectors."""


def give(account: Account, out: Path | None, write: Callable[[Any], None]) -> None:
    """Draw a figure or page where asked, write the numbers, and print what there is to say."""
    r, source = account.recording, read_from(account.recording)
    if out:
        _draw(account, [*account.guidance, source, *account.notes], out)
    numbers = {
        "recording": str(r.place), "assumed": source, "notes": account.notes, "samples": len(r.time),
        "first_sample_s": r.first_s, "duration_s": r.time[-1], "rate_hz": r.rate,
    }  # fmt: skip
    write(numbers | account.numbers)
    console = Console(highlight=False, soft_wrap=True)
    first = (
        f"{r.place}: {len(r.time)} samples in {r.time[-1]:.1f} s, {r.rate:.4g} Hz, the first at {r.first_s:.3f} s:"
        " times below count from it."
    )
    for sentence in (first, source, *account.notes):
        console.print(sentence, markup=False)
    show(console, account.tables)
    for sentence in account.guidance:
        console.print(sentence, markup=False)
    if out:
        print(f"{'Page' if out.suffix == '.html' else 'Figure'}: {out}")


def _draw(account: Account, sentences: list[str], out: Path) -> None:
    """Write the first of the figures, or with the ending .html a page of all with sentences and tables."""
    figures = account.figures()
    if out.suffix == ".html":
        from pretouch.reporting.page import detection_page

        page = detection_page(account.recording.place.name, sentences, account.tables, figures)
        with unwritable_said("page", out):
            atomic_write(out, page)
        return
    image = BytesIO()
    figures[0][0].savefig(image, format=out.suffix[1:], dpi=_DOTS_PER_INCH)
    with unwritable_said("figure", out):
        out.write_bytes(image.getvalue())
