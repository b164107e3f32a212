"""A page, one HTML file with all in it, and its pieces. All text is escaped but what is `Html` already."""

from collections.abc import Iterable, Sequence
from html import escape
from string import Template

import numpy as np

from pretouch import __version__
from pretouch.text_table import TextTable

NOTHING = "–"
"""Stands where there is no number."""


class Html(str):
    """Text that is HTML and stays as it is."""

    __slots__ = ()


_PAGE = Template(
    """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$title</title>
<style>$style</style>
</head>
<body>
<main>
$body
<footer>Written by Pretouch $version. Nothing here claims conformity with a safety standard.</footer>
</main>
</body>
</html>
"""
)

_STYLE = """
:root { --ink: #1f2933; --soft: #616e7c; --line: #dde3e9; --ground: #fff; --other: #fdf3d8; --bad: #c53030; }
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --soft: #9aa5b1; --line: #3a4653; --ground: #171c22; --other: #4a3d16; --bad: #fc8181; }
  figure img { filter: invert(.9) hue-rotate(180deg); }
}
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--ground); margin: 0; }
main { max-width: 68rem; margin: 2rem auto; padding: 0 1.2rem; }
h1 { font-size: 1.7rem; line-height: 1.2; } h2 { font-size: 1.35rem; overflow-wrap: anywhere; }
h1, h2 { margin: 0 0 .6rem; } h3 { font-size: 1.08rem; margin: 2rem 0 .5rem; } h4 { margin: 1rem 0 .3rem; }
.summary { font-size: 1.05rem; max-width: 52rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .82rem; margin: .5rem 0; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .22rem .55rem; text-align: right; vertical-align: top; }
td { white-space: nowrap; } td.w { white-space: normal; }
th { font-weight: 600; } thead th { vertical-align: bottom; color: var(--soft); border-bottom-color: var(--soft); }
.w { text-align: left; } .facts th { color: var(--soft); font-weight: 400; white-space: nowrap; }
.facts td { overflow-wrap: anywhere; }
.columns { display: flex; flex-wrap: wrap; gap: 0 3rem; }
.vector { white-space: pre; } .note, figcaption, footer { color: var(--soft); font-size: .82rem; max-width: 52rem; }
.bad { color: var(--bad); font-weight: 600; } .other { background: var(--other); padding: 0 .3rem; }
figure { margin: 1rem 0; } figure img { max-width: 100%; height: auto; background: #fff; }
footer { border-top: 1px solid var(--line); margin-top: 2.5rem; padding-top: .5rem; }
@media print {
  body { font-size: 10pt; } main { max-width: none; margin: 0; }
  figure, tr { break-inside: avoid; } h3 { break-after: avoid; }
  .scroll { overflow: visible; }
}
"""

_FIGURE_SPACE = "\u2007"
"""As wide as a digit."""
MOST_ROWS = 200
"""Most rows of a table: those of an hour would hide all else."""
_COMPONENT = 5
"""Characters of a component of a vector."""

Text = str | Html
Row = dict[str, Text]
"""Cells of a row by their heading."""


def html(text: Text) -> Html:
    """Escape what is not HTML yet."""
    return text if isinstance(text, Html) else Html(escape(text))


def joined(parts: Iterable[Text], between: str = "\n") -> Html:
    """Put parts one after the other."""
    return Html(between.join(html(part) for part in parts))


def element(name: str, content: Text, kind: str = "") -> Html:
    """One element with a class."""
    attribute = f' class="{escape(kind)}"' if kind else ""
    return Html(f"<{name}{attribute}>{html(content)}</{name}>")


def bad(text: Text) -> Html:
    """Mark what is wrong."""
    return element("span", text, "bad")


def table(rows: Sequence[Row], note: Text = "", names: int = 1, title: str = "") -> Html:
    """Make a table of rows; the first columns, `names` of them, hold words and the others numbers. None of no rows.

    Of very many rows the last are left out, and the note says so.
    """
    if not rows:
        return Html("")
    more = len(rows) - MOST_ROWS
    if more > 0:
        note = joined([f"{more} more are left out here; all count in the summary.", note], " ")
    lines = tuple(tuple(row.values()) for row in rows[:MOST_ROWS])
    return table_html(TextTable(title, tuple(rows[0]), lines, note, names), "h4")


def table_html(contents: TextTable, heading: str = "h3") -> Html:
    """Make a table with its title above, as a heading, and its note below, where it has them."""

    def line(cells: Sequence[Text], name: str) -> Html:
        kinds = ["w" if i < contents.names else "" for i in range(len(cells))]
        texts = (cell if isinstance(cell, Html) else joined(cell.split("\n"), "<br>") for cell in cells)
        return element("tr", joined((element(name, c, k) for c, k in zip(texts, kinds, strict=True)), ""))

    body = element("tbody", joined(line(row, "td") for row in contents.rows))
    grid = element("table", Html(element("thead", line(contents.header, "th")) + body))
    title = [element(heading, contents.title)] if contents.title else []
    note = [element("p", contents.note, "note")] if contents.note else []
    return joined([*title, element("div", grid, "scroll"), *note])


def document(title: str, body: Html) -> str:
    """Make a page of what is in its body."""
    return _PAGE.substitute(title=html(title), style=_STYLE, body=body, version=__version__)


def facts(rows: Iterable[tuple[Text, Text]]) -> Html:
    """Make a table of names and what they are."""
    lines = (element("tr", joined((element("th", name, "w"), element("td", value, "w")), "")) for name, value in rows)
    return element("div", element("table", element("tbody", joined(lines)), "facts"), "scroll")


def number(value: float | None, digits: int, factor: float = 1.0) -> str:
    """Write a number with so many digits after the point."""
    if value is None or not np.isfinite(value):
        return NOTHING
    text = f"{value * factor:.{digits}f}"
    rounded_to_zero = not text.strip("-0.")
    return text.lstrip("-") if rounded_to_zero else text.replace("-", "−")


def vector(values: Iterable[float], digits: int) -> Html:
    """Write the components of a vector, each as wide as the others."""
    texts = (number(float(v), digits).rjust(_COMPONENT, _FIGURE_SPACE) for v in values)
    return element("span", " ".join(texts), "vector")


def percent(value: float | None, digits: int = 0) -> str:
    """Write a share."""
    if value is not None and value > 100:
        return "> 10000 %"
    text = number(value, digits, 100.0)
    return text if text == NOTHING else f"{text} %"
