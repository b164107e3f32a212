"""What `pretouch report` does: one page of what recordings tell."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import tyro

from pretouch.cli.writing import check_writable, unwritable_said
from pretouch.errors import RecordingError
from pretouch.extras import FIGURES
from pretouch.recording.reader import open_recording
from pretouch.reporting.measures import Measures, measure


@dataclass(frozen=True)
class Report:
    """Write a report of recordings as one page that needs no network: contacts, forces, distances, margins, health."""

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Recordings."""
    out: Path = Path("report.html")
    """File to write."""
    replace: bool = False
    """Overwrite a file that is there though it is no report of these recordings."""

    def run(self) -> None:
        """Write the page."""
        print(f"Report: {write_page(self.files, self.out, self.replace)}")


def write_page(files: Sequence[Path], out: Path, replace: bool = False) -> Path:
    """Write the report of some recordings, and return the page's path.

    Args:
        files: recordings, each once.
        out: HTML file to write.
        replace: whether to overwrite a file that is no report of these recordings.
    """
    if not files:
        raise RecordingError("No recording is given: give at least one file.")
    twice = [place for place, times in Counter(place.resolve() for place in files).items() if times > 1]
    if twice:
        raise RecordingError(f"The recording {twice[0]} is given more than once: give each once.")
    if out.resolve() in [place.resolve() for place in files]:
        raise RecordingError(f"The report {out} would be written over the recording: give another --out.")
    FIGURES.need("A report")
    check_writable("report", out)
    mark = _mark(files)
    if out.is_file() and not replace and mark not in out.read_bytes():
        raise RecordingError(
            f"{out} is there already and no report of {'these recordings' if files[1:] else files[0]}: give another"
            " --out, or --replace."
        )
    from pretouch.reporting.page import page  # needs the extra

    text = page(_measured(files))
    with unwritable_said("report", out):
        out.write_bytes(text.encode("utf-8", errors="replace") + mark)  # a file name may be no text
    return out


def _mark(files: Sequence[Path]) -> bytes:
    """Return a comment of HTML by which a page is known as that of some recordings as they are."""
    known = sorted((str(place.resolve()), *_version(place)) for place in files)
    return f"<!-- recordings {sha256(repr(known).encode(errors='surrogateescape')).hexdigest()} -->\n".encode()


def _version(place: Path) -> tuple[int, ...]:
    """Size and time of the last change of a file, nothing where there is none."""
    try:
        found = place.stat()
    except OSError:
        return ()
    return found.st_size, found.st_mtime_ns


def _measured(files: Sequence[Path]) -> Iterator[Measures]:
    for place, title in zip(files, titles(files), strict=True):
        yield measure(open_recording(place), title)


def titles(files: Sequence[Path]) -> list[str]:
    """Name of each file, with as many of its folders as tell it from the others."""
    whole = [place.absolute().parts for place in files]
    lengths = [1] * len(files)
    while True:
        shown = ["/".join(parts[-length:]) for parts, length in zip(whole, lengths, strict=True)]
        again = [i for i, title in enumerate(shown) if shown.count(title) > 1 and lengths[i] < len(whole[i])]
        if not again:
            return shown
        for i in again:
            lengths[i] += 1
