"""Width of the thresholds' band against the distance of a hand from six directions."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pretouch_lab.paper.claims.approach import DIRECTIONS
from pretouch_lab.paper.figures.marks import AXES, labels
from pretouch_lab.rows import Row

_STYLES = {"upper": ("-", "tab:red"), "lower": ("--", "tab:blue")}
_MARKERS = "osd"
"""Of the axes x, y and z."""


def band_figure(cells: list[Row]) -> Figure:
    """Medians of the six widths at each distance, one panel a direction, with what eq. 11 promises dashed.

    Distances are of the hand's centre from the end-effector's origin; eq. 11 is for the nearest point of the fist.
    """
    figure = Figure(figsize=(10, 6.8), layout="constrained")
    panels = figure.subplots(2, 3, sharex=True, sharey=True).T.ravel()
    by_direction = {cell["from"]: cell for cell in cells}
    for axes, (direction, shown) in zip(panels, DIRECTIONS.items(), strict=True):
        axes.set_title(f"from {shown}")
        axes.set_xlabel("distance of the hand [m]")
        axes.grid(alpha=0.3)
        if direction in by_direction:
            _panel(axes, by_direction[direction])
    handles, names = labels(panels)
    if handles:
        figure.legend(handles, names, loc="outside lower center", ncols=8, fontsize="small")
    figure.supylabel("threshold from the mean [N]")
    figure.suptitle("Filled markers: the threshold on the hand's side. Dashed black: eq. 11", fontsize="medium")
    return figure


def _panel(axes: Axes, cell: Row) -> None:
    places = [place for place in cell["curve"] if place["trials"]]
    for name in places[0]["width_n"] if places else ():
        bound, axis = name.split("_")
        style, colour = _STYLES[bound]
        widths = [place["width_n"][name]["median"] for place in places]
        label = f"{'T_u - mu' if bound == 'upper' else 'mu - T_l'}, {axis}"
        marker = _MARKERS[AXES.index(axis)]
        filled = colour if name == cell["expected"] else "white"
        axes.plot(
            [p["distance_m"] for p in places], widths, style, color=colour, marker=marker, mfc=filled, label=label
        )
    if places:
        free = max(spread["median"] for place in places for spread in place["width_n"].values())
        promised = [free - place["equation_11_n"] for place in cell["curve"]]
        distance = [place["distance_m"] for place in cell["curve"]]
        axes.plot(distance, promised, color="black", ls=(0, (6, 2)), lw=2, label="eq. 11")
    if cell["seen"]:
        axes.axvline(cell["seen_from_m"]["median"], color="black", ls=":", lw=1.2, label="first seen")
    else:
        axes.text(0.5, 0.5, "no unit sees the hand", transform=axes.transAxes, ha="center", bbox={"fc": "white"})
