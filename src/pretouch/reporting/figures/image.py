"""A figure as part of a page: no file beside it, nothing to fetch."""

from base64 import b64encode
from contextlib import AbstractContextManager
from html import escape
from io import BytesIO
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from pretouch.reporting.html import Html, element, html

_STYLE: Any = {
    "font.size": 9.0, "axes.labelsize": 9.0, "axes.edgecolor": "#616e7c", "svg.hashsalt": "pretouch",
    "svg.fonttype": "path", "path.simplify_threshold": 0.3, "axes.formatter.useoffset": False,
}  # fmt: skip


def style() -> AbstractContextManager[None]:
    """Context in which the figures of a report are made and drawn."""
    return matplotlib.rc_context(_STYLE)


def picture(figure: Figure, text: str) -> Html:
    """Draw a figure as SVG into the page, with a caption."""
    image = BytesIO()
    figure.savefig(
        image, format="svg", dpi=160, bbox_inches="tight", pad_inches=0.05, metadata={"Date": None, "Creator": None}
    )
    data = b64encode(image.getvalue()).decode("ascii")
    shown = Html(f'<img src="data:image/svg+xml;base64,{data}" alt="{escape(text)}">')
    return element("figure", Html(shown + element("figcaption", html(text))))
