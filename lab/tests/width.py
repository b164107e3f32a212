"""How wide a table is in a terminal."""

from pretouch.text_table import TextTable


def width(table: TextTable) -> int:
    """Characters of the widest row, with a space between columns: beyond 80 lines may be longer than a terminal's."""
    columns = zip(table.header, *table.rows, strict=True)
    widths = [max(len(line) for text in column for line in text.split("\n")) for column in columns]
    return sum(widths) + len(widths) - 1
