"""A table of finished text, for the terminal, for documents and for pages."""

from dataclasses import dataclass


@dataclass(frozen=True)
class TextTable:
    """A table of finished text."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str
    names: int = 2
    """How many columns at the left hold names, not numbers."""


def markdown(table: TextTable, level: int = 3) -> str:
    """Write a table for a document, with its title as a heading of that level and its note below."""
    rows = [table.header, ("---",) * len(table.header), *table.rows]
    cells = [[cell.replace("|", "\\|").replace("\n", "<br>") for cell in row] for row in rows]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    return "\n".join([f"{'#' * level} {table.title}", "", *lines, "", table.note, ""])
