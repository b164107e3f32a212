"""Tables a run writes into a document, between markers; the text around them is written by hand."""

from collections.abc import Iterable
from pathlib import Path

from pretouch.errors import ExperimentError
from pretouch_lab.experiment import Picture

BENCHMARKS, LOCALIZATION, SHIELD = (f"results/{name}.md" for name in ("benchmarks", "localization", "shield"))
"""Generated documents, in a folder of documents."""


def begin_mark(part: str) -> str:
    """Return the line that begins a generated part."""
    return f"<!-- {part}: generated, begin -->"


def end_mark(part: str) -> str:
    """Return the line that ends it."""
    return f"<!-- {part}: generated, end -->"


def put(path: Path, part: str, text: str) -> None:
    """Put a text between the markers of a part of a document.

    A document that cannot be read or written, or has no such markers, in this order, is an ExperimentError.
    """
    before, after = around(path, part)
    try:
        path.write_text(f"{before}{begin_mark(part)}\n\n{text.strip()}\n\n{end_mark(part)}{after}", encoding="utf-8")
    except OSError as error:
        raise ExperimentError(f"The document {path} cannot be written: {error.strerror}: give another.") from error


def draw(pictures: Iterable[Picture], folder: Path) -> None:
    """Write figures into a folder, which is made. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    for picture in pictures:
        picture.figure.savefig(folder / f"{picture.name}.png", dpi=120)


def shown(picture: Picture) -> str:
    """Refer to a figure from a document in `results`."""
    return f"![{picture.text}](../images/{picture.name}.png)\n\n*{picture.text}.*"


def around(path: Path, part: str) -> tuple[str, str]:
    """Return what stands before and after a part of a document; an ExperimentError where it has no place for it."""
    begin, end = begin_mark(part), end_mark(part)
    try:
        before, found, rest = path.read_text(encoding="utf-8").partition(begin)
    except OSError as error:
        raise ExperimentError(f"The document {path} cannot be read: {error.strerror}: give another.") from error
    _, also, after = rest.partition(end)
    if not found or not also:
        raise ExperimentError(f"The document {path} has no place for {part}: write {begin} and {end} into it.")
    return before, after
