"""Tables of finished text in the terminal."""

from collections.abc import Collection, Iterable, Sequence
from itertools import zip_longest

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pretouch.text_table import TextTable


def show(console: Console, tables: Iterable[TextTable]) -> None:
    """Print tables with title and note, one below the other."""
    for table in tables:
        console.print()
        console.print(table.title, style="bold", markup=False)
        drawn = _empty()
        for i, text in enumerate(table.header):
            if i < table.names:  # in a narrow terminal numbers are broken, names are not
                lines = (line for row in table.rows for line in row[i].split("\n"))
                drawn.add_column(escape(text), min_width=max(map(len, lines), default=0))
            else:
                drawn.add_column(escape(text), justify="right", overflow="fold")
        for row in table.rows:
            drawn.add_row(*map(escape, row))
        console.print(drawn)
        console.print(table.note, style="dim", markup=False)
    console.print()


def grid(
    header: Sequence[str], rows: Iterable[Sequence[str]], left: Collection[int] = (0,), whole: int | None = None,
    styles: Iterable[str] = (),
) -> Table:  # fmt: skip
    """Make a table without lines.

    Args:
        header: headings of the columns.
        rows: their cells.
        left: columns that are aligned left, as words are.
        whole: the first column that is never broken into lines; None, and all may be.
        styles: of each row; those without are plain.
    """
    drawn = _empty()
    for i, name in enumerate(header):
        kept = whole is not None and i >= whole
        drawn.add_column(
            escape(name),
            justify="left" if i in left else "right",
            no_wrap=kept,
            overflow="ellipsis" if kept else "fold",
        )
    for row, style in zip_longest(rows, styles, fillvalue=""):
        drawn.add_row(*map(escape, row), style=style)
    return drawn


def _empty() -> Table:
    return Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
