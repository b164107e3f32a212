"""What misplaced units change, against the size of their error."""

from operator import itemgetter

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.paper.figures.marks import labels
from pretouch_lab.rows import Row

_BOARD = (
    ("true_peak_20ms_n_ratio", "-", "o", "black", "true 20 ms peak"),
    ("peak_estimate_n_ratio", "--", "s", "tab:blue", "peak of the estimate"),
    ("impact_speed_m_s_ratio", ":", "^", "tab:red", "impact speed"),
)
_ROOM = (
    ("speed_scale", "-", "o", "black", "mean speed factor"),
    ("obstacle_fraction", "--", "s", "tab:red", "steps with an obstacle"),
)
_OVER = (
    ("position_mm", "orientation_deg", "error of each unit's position [mm]"),
    ("orientation_deg", "position_mm", "error of each unit's orientation [deg]"),
)


def mounting_figure(cells: list[Row]) -> Figure | None:
    """Medians with 10-90 % by error of position and of orientation.

    Above the ratios at the board to units in their place, below what happens in an empty room.
    """
    shown = [cell for cell in cells if cell["trajectory"] == "all" and cell["told"] == "untold"]
    shown = [cell for cell in shown if cell["restrictions"] not in ("hard", "slack")]
    if not shown:
        return None
    shown = [cell for cell in shown if cell["profile"] == shown[0]["profile"]]
    figure = Figure(figsize=(10, 6.8), layout="constrained")
    panels = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, (over, other, words) in enumerate(_OVER):
        own = sorted((cell for cell in shown if not cell[other]), key=itemgetter(over))
        for row, (side, curves) in enumerate((("boards", _BOARD), ("room", _ROOM))):
            _panel(panels[row, column], [cell for cell in own if cell["side"] == side], over, curves)
        panels[1, column].set_xlabel(words)
    panels[0, 0].set(ylabel="at the board, ratio to no error [1]", ylim=(0.4, 1.6))
    panels[1, 0].set(ylabel="in an empty room [1]", ylim=(-0.03, 1.05))
    for panel, place in zip(panels[:, 0], ("lower left", "center left"), strict=True):
        panel.legend(*labels([panel]), fontsize="small", loc=place)
    figure.suptitle("Units that sit elsewhere than the controller believes", fontsize="medium")
    return figure


def _panel(axes: Axes, cells: list[Row], over: str, curves: tuple[tuple[str, str, str, str, str], ...]) -> None:
    axes.grid(alpha=0.3)
    apart = 0.008 * max((cell[over] for cell in cells), default=0.0)
    for k, (name, style, marker, colour, label) in enumerate(curves):
        own = [(cell[over], cell[name]) for cell in cells if cell[name]]
        middle = [value["median"] for _, value in own]
        spread = [[v["median"] - v["p10"] for _, v in own], [v["p90"] - v["median"] for _, v in own]]
        # side by side, so that bars do not hide each other
        at = [x + apart * (k - (len(curves) - 1) / 2) for x, _ in own]
        axes.errorbar(
            at, middle, yerr=spread, ls=style, marker=marker, color=colour, ms=5, lw=1.4, capsize=3, label=label
        )
