"""Tables of finished text in the terminal."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from rich.console import Console, ConsoleOptions, RenderResult
from rich.markup import escape
from rich.table import Table

from pretouch.text_table import TextTable, blocks


def show(console: Console, tables: Iterable[TextTable]) -> None:
    """Print tables with title and note, one below the other."""
    for table in tables:
        console.print()
        console.print(table.title, style="bold", markup=False)
        console.print(Grid(table.header, table.rows, table.names, range(table.names)))
        console.print(table.note, style="dim", markup=False)
    console.print()


@dataclass(frozen=True)
class Grid:
    """A table without lines; what does not fit beside its first columns stands below, beside these columns again."""

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    names: int = 1
    """How many columns at the left stand in each part."""
    left: Collection[int] = (0,)
    """Columns that are aligned left, as words are."""
    broken: int = 0
    """How many columns at the left may be broken into lines, for the others to stand side by side."""
    styles: Iterable[str] = ()
    """Of each row; those without are plain."""

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw it as wide as the terminal is."""
        columns = [[self.header[i], *(row[i] for row in self.rows)] for i in range(len(self.header))]
        for n, block in enumerate(blocks(columns, options.max_width, self.names, self.broken)):
            if n:
                yield ""
            drawn = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False)
            for i, width in block:
                drawn.add_column(
                    escape(self.header[i]), justify="left" if i in self.left else "right", width=width, overflow="fold"
                )
            for row, style in zip_longest(self.rows, self.styles, fillvalue=""):
                drawn.add_row(*(escape(row[i]) for i, _ in block), style=style)
            yield drawn
