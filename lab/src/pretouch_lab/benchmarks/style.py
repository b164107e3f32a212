"""How baselines look in all figures: one colour and one kind of line each, told apart by the colour-blind too."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.benchmarks.ablations import WITHOUT

_LOOKS = {
    "blind": ("#000000", "-", "s"),
    "fixed": ("#8c8c8c", "-", "v"),
    "observer": ("#56b4e9", "-", "^"),
    "flacco": ("#cc79a7", "-", "v"),
    "flacco-surface": ("#cc79a7", "--", "^"),
    "ding": ("#009e73", "-", "D"),
    "ding-near": ("#009e73", "--", "d"),
    "paper": ("#d55e00", "-", "P"),
    "paper-raw": ("#e69f00", "-", "X"),
    "paper-off": ("#e69f00", "--", "X"),
    "pretouch": ("#0072b2", "-", "o"),
}
"""Colour (Okabe and Ito, 2008), line and marker of each baseline."""
_OTHER = ("#b5b500", ":", "h")


def colour(baseline: str) -> str:
    """Return a baseline's colour."""
    return _LOOKS.get(baseline, _OTHER)[0]


def point(baseline: str) -> dict[str, Any]:
    """Return how a baseline's point is drawn: hollow where its line is broken."""
    colour, dashes, marker = _LOOKS.get(baseline, _OTHER)
    return {"color": colour, "marker": marker, "ls": "", "mfc": "none" if dashes == "--" else colour, "mew": 1.5}


def marker(baseline: str) -> str:
    """Return a baseline's marker."""
    return _LOOKS.get(baseline, _OTHER)[2]


def line(baseline: str) -> dict[str, Any]:
    """Return how a baseline's line is drawn: ours is wider, and none is hidden by it."""
    ours = baseline == "pretouch"
    return {
        "color": colour(baseline),
        "ls": _LOOKS.get(baseline, _OTHER)[1],
        "lw": 2.2 if ours else 1.3,
        "zorder": 2.0 if ours else 2.5,
    }


def shown(names: list[str]) -> list[str]:
    """Return the baselines that figures show: ablations are in tables."""
    return [name for name in names if not name.startswith(WITHOUT)]


def plain(axes: Axes) -> None:
    """Take away what a reader does not need."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(alpha=0.25, lw=0.6)


def legend_above(figure: Figure, axes: Axes, columns: int) -> None:
    """Put the legend of some axes above all."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, frameon=False)
