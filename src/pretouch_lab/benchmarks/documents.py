"""Tables a benchmark writes into a document, between markers; the text around them is written by hand."""

from pathlib import Path

from pretouch.errors import ExperimentError
from pretouch_lab.experiment import Picture

DOCUMENT = "results/benchmarks.md"
"""In a folder of documents."""


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


def publish(part: str, text: str, pictures: list[Picture], out: Path, docs: Path | None) -> list[Path]:
    """Write figures into a run's folder, or with `docs` into its images, and there a part of the document."""
    folder = docs / "images" if docs else out / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    for picture in pictures:
        picture.figure.savefig(folder / f"{picture.name}.png", dpi=120)
    if docs is None:
        return [folder]
    put(docs / DOCUMENT, part, text)
    return [folder, docs / DOCUMENT]


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
