"""What small forces are paid for with: the force at the board against the time beside a person, in one picture."""

from matplotlib.figure import Figure

from pretouch_lab.benchmarks import style
from pretouch_lab.rows import Row

TRADE = (
    "Force at a board of 25 N/mm against the time of a turn beside a person 0.4 m away, median and 10-90 %;"
    " the lower left is better"
)
_OPEN = 1.1
"""Where a turn that did not end is drawn, times the longest that did."""


def trade_points(summary: Row) -> dict[str, tuple[Row, Row]]:
    """Return for each baseline its cells of the boards and of the person."""
    of = {(cell["family"], cell["contender"]): cell for cell in summary["families"]}
    names = style.shown([name for family, name in of if family == "static"])
    return {name: (of["static", name], of["person", name]) for name in names if ("person", name) in of}


def trade(summary: Row) -> Figure:
    """Draw each baseline as a point; at the right edge those whose turn did not end, at 0 N those without contact."""
    points = trade_points(summary)
    ends = [p["cycle_time_s"]["p90"] or p["cycle_time_s"]["median"] for _, p in points.values()]
    open_s = _OPEN * max((end for end in ends if end is not None), default=10.0)
    figure = Figure(figsize=(7.5, 4.6), layout="constrained")
    ax = figure.subplots()
    for name, (board, person) in points.items():
        time, force, colour = person["cycle_time_s"], board["true_peak_20ms_n"], style.colour(name)
        x = open_s if time["median"] is None else time["median"]
        left, right = (open_s if time[key] is None else time[key] for key in ("p10", "p90"))
        ax.plot([left, right], [force["median"]] * 2, color=colour, lw=1.2)
        ax.plot([x, x], [force["p10"], force["p90"]], color=colour, lw=1.2)
        ended = "" if time["median"] is not None else ", turn not ended"
        label = f"{name} ({board['contacts']}/{board['trials']} touched{ended})"
        ax.plot(x, force["median"], ms=9, label=label, clip_on=False, zorder=3, **style.point(name))
    ax.set_xlabel("time of a turn beside a person [s]")
    ax.set_ylabel("true force at the board, 20 ms peak [N]")
    ax.set_xlim(left=0.0, right=1.02 * open_s)
    ax.set_ylim(bottom=0.0, top=1.05 * max(board["true_peak_20ms_n"]["p90"] for board, _ in points.values()) + 1.0)
    style.plain(ax)
    ax.legend(loc="center left", bbox_to_anchor=(1.02, 0.5), fontsize=8, frameon=False)
    return figure
