"""Tables of finished text in the terminal."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from rich.console import Console, ConsoleOptions, RenderResult
from rich.markup import escape
from rich.table import Table

from pretouch.text_table import TextTable

_BROKEN = 8
"""Characters that the first column keeps at least, where those beside it need the room."""


def show(console: Console, tables: Iterable[TextTable]) -> None:
    """Print tables with title and note, one below the other."""
    for table in tables:
        console.print()
        console.print(table.title, style="bold", markup=False)
        console.print(PlainTable(table.header, table.rows, range(table.names)), crop=False)
        console.print(table.note, style="dim", markup=False)
    console.print()


@dataclass(frozen=True)
class PlainTable:
    """A table without lines. Where the terminal is narrow, headings are wrapped and names in the first column broken.

    All else stays whole: print it with `crop=False`.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: Collection[int] = (0,)
    """Columns that are aligned left, as words are."""
    styles: Iterable[str] = ()
    """Style of each row; rows without one are plain."""

    def __rich_console__(self, _console: Console, options: ConsoleOptions) -> RenderResult:
        """Draw it as wide as the terminal is."""
        cells = [[line for row in self.rows for line in row[i].split("\n")] for i in range(len(self.header))]
        columns = list(zip(self.header, cells, strict=True))
        widths = [max(map(len, [*heading.split("\n"), *lines])) for heading, lines in columns]
        room = options.max_width - len(widths) + 1
        if sum(widths) > room:
            first, *others = (max(map(len, [*heading.split(), *lines]), default=0) for heading, lines in columns)
            least = _BROKEN if 0 in self.left else first
            widths = [min(first, max(least, room - sum(others))), *others]
        drawn = Table(box=None, padding=(0, 1, 0, 0), pad_edge=False, width=sum(widths) + len(widths) - 1)
        for i, (heading, width) in enumerate(zip(self.header, widths, strict=True)):
            drawn.add_column(
                escape(heading), justify="left" if i in self.left else "right", width=width, overflow="fold"
            )
        for row, style in zip_longest(self.rows, self.styles, fillvalue=""):
            drawn.add_row(*map(escape, row), style=style)
        yield drawn
