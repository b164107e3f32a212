"""The paper's figures by name: which trials each needs, and how it is drawn of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pretouch.errors import ExperimentError
from pretouch.profiles import Profile, profile
from pretouch.recording.run_record import RunRecord
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.paper import avoidance, dynamic, static
from pretouch_lab.paper.claims import between

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Played = list[tuple[Cell, RunRecord]]


@dataclass(frozen=True)
class PaperFigure:
    """One figure of the paper."""

    cells: Callable[[str], list[Cell]]
    """Trials it needs for a profile of a name."""
    draw: Callable[[Played, tuple[str, ...], Profile], "Figure"]
    """Draws it of these trials, for a skin with units of some names and the profile."""


def _beside(name: str) -> list[Cell]:
    return [cell for cell in avoidance.cells(Grid((name,))) if cell.where["place"] == "beside"]


def _against_blind(name: str) -> list[Cell]:
    if profile(name).perception is None:
        raise ExperimentError(f"The figure force-difference cannot show {name}, which has no proximity: name another.")
    return static.cells(Grid(("blind", name)))


def _circle(played: Played, _units: tuple[str, ...], used: Profile) -> "Figure":
    from pretouch_lab.paper.figures.circle import circle_figure

    return circle_figure(played[0][1], used)


def _interaction(played: Played, units: tuple[str, ...], used: Profile) -> "Figure":
    from pretouch_lab.paper.figures.interaction import interaction_figure

    return interaction_figure(played[0][1], units, used)


def _close_up(played: Played, units: tuple[str, ...], used: Profile) -> "Figure":
    from pretouch_lab.paper.figures.close_up import close_up_figure

    return close_up_figure(played[0][1], units, used)


def _force_difference(played: Played, _units: tuple[str, ...], used: Profile) -> "Figure":
    from pretouch_lab.paper.figures.force_difference import force_difference_figure

    traces = {(str(c.where["trajectory"]), str(c.where["side"]), c.profile): trace for c, trace in played}
    return force_difference_figure(traces, (used.name,))


CATALOGUE: dict[str, PaperFigure] = {
    "circle": PaperFigure(_beside, _circle),
    "interaction": PaperFigure(lambda name: dynamic.cells(Grid((name,))), _interaction),
    "close-up": PaperFigure(lambda name: between.cells(Grid((name,))), _close_up),
    "force-difference": PaperFigure(_against_blind, _force_difference),
}
