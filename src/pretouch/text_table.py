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
    """How many columns at the left hold names, not numbers."""


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


_BROKEN = 8
"""Characters that a column keeps which may be broken."""


def blocks(columns: Sequence[Sequence[str]], width: int, names: int, broken: int = 0) -> list[list[tuple[int, int]]]:
    """Split columns into blocks that fit a width; return number and width of each column of each block.

    Headings are wrapped between words. A cell is broken where nothing else makes it fit.

    Args:
        columns: cells of each column, the heading first.
        width: characters of a line, with a space between columns.
        names: how many columns at the left stand in each block.
        broken: how many of them may be broken into lines, for the others to stand side by side.
    """
    cells = [[line for cell in column[1:] for line in cell.split("\n")] for column in columns]
    wide = [max(map(len, (*column[0].split("\n"), *lines))) for column, lines in zip(columns, cells, strict=True)]
    least = [
        max(map(len, (*column[0].split(), *lines)), default=0) for column, lines in zip(columns, cells, strict=True)
    ]
    least[:broken] = [min(each, _BROKEN) for each in least[:broken]]
    for_names = max(width - max(least[names:], default=0), width // 2, 2 * names)
    while sum(least[:names]) + names > for_names:
        least[least.index(max(least[:names]))] -= 1
    room = width - sum(least[:names]) - names
    found: list[list[int]] = [[]]
    for i in range(names, len(columns)):
        least[i] = max(1, min(least[i], room))
        if found[-1] and sum(least[k] + 1 for k in found[-1]) + least[i] > room:
            found.append([])
        found[-1].append(i)
    return [_widened([*range(names), *block], least, wide, width) for block in found]


def _widened(block: list[int], least: list[int], wide: list[int], width: int) -> list[tuple[int, int]]:
    """Give what is left of a line to the columns that would be wider, from the left."""
    left, made = width - sum(least[i] for i in block) - len(block) + 1, []
    for i in block:
        more = max(0, min(wide[i] - least[i], left))
        left -= more
        made.append((i, least[i] + more))
    return made
