"""Tables of finished text in the terminal."""

from collections.abc import Iterable

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from pretouch.text_table import TextTable


def show(console: Console, tables: Iterable[TextTable]) -> None:
    """Print tables with title and note, one below the other."""
    for table in tables:
        console.print()
        console.print(table.title, style="bold", markup=False)
        drawn = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
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
