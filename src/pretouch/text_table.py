"""A table of finished text, for the terminal, for documents and for pages."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class TextTable:
    """A table of finished text."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str
    names: int = 2
    """Number of columns at the left that hold names."""


Column = tuple[str, Callable[[Any], str]]
"""Heading of a column, with its unit, and how the value of a row is written."""


def tabulated(title: str, columns: Sequence[Column], rows: Iterable[Any], note: str, names: int = 2) -> TextTable:
    """Write each row in each column."""
    header, written = tuple(heading for heading, _ in columns), [write for _, write in columns]
    return TextTable(title, header, tuple(tuple(write(row) for write in written) for row in rows), note, names)


def markdown(table: TextTable, level: int = 3) -> str:
    """Write a table for a document, with its title as a heading of that level and its note below."""
    rows = [table.header, ("---",) * len(table.header), *table.rows]
    cells = [[cell.replace("|", "\\|").replace("\n", "<br>") for cell in row] for row in rows]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    return "\n".join([f"{'#' * level} {table.title}", "", *lines, "", table.note, ""])
