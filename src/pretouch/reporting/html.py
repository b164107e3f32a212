"""Pieces of a page. All text is escaped but what is `Html` already."""

from collections.abc import Iterable, Sequence
from html import escape

import numpy as np

NOTHING = "–"
"""Stands where there is no number."""


class Html(str):
    """Text that is HTML and stays as it is."""

    __slots__ = ()


_FIGURE_SPACE = "\u2007"
"""As wide as a digit."""
_COMPONENT = 5
"""Characters of a component of a vector."""

Text = str | Html


def html(text: Text) -> Html:
    """Escape what is not HTML yet."""
    return text if isinstance(text, Html) else Html(escape(text))


def joined(parts: Iterable[Text], between: str = "\n") -> Html:
    """Put parts one after the other."""
    return Html(between.join(html(part) for part in parts))


def element(name: str, content: Text, kind: str = "", anchor: str = "") -> Html:
    """One element with a class and an id."""
    attributes = f' class="{escape(kind)}"' if kind else ""
    attributes += f' id="{escape(anchor)}"' if anchor else ""
    return Html(f"<{name}{attributes}>{html(content)}</{name}>")


def bad(text: Text) -> Html:
    """Mark what is wrong."""
    return element("span", text, "bad")


def note(text: Text) -> Html:
    """Write a remark below a table or figure."""
    return element("p", text, "note")


def table(head: Sequence[Text], rows: Sequence[Sequence[Text]], words: int = 1) -> Html:
    """Make a table whose first columns, `words` of them, hold words and the others numbers."""

    def line(cells: Sequence[Text], name: str) -> Html:
        kinds = ["w" if i < words else "" for i in range(len(cells))]
        return element("tr", joined((element(name, c, k) for c, k in zip(cells, kinds, strict=True)), ""))

    body = joined(line(row, "td") for row in rows)
    whole = element("thead", line(head, "th")) + element("tbody", body)
    return element("div", element("table", Html(whole)), "scroll")


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
