"""What `pretouch figure` does: one of the paper's figures, from trials that are played for it."""

from io import BytesIO
from pathlib import Path
from typing import cast

from rich.console import Console

from pretouch.cli.writing import check_writable, unwritable_said
from pretouch.errors import ExperimentError
from pretouch.profiles import profile as find_profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import paper_skin
from pretouch_lab.cell import Cell, Context
from pretouch_lab.paper.figures.catalogue import CATALOGUE, Played
from pretouch_lab.registry import EXPERIMENTS
from pretouch_lab.trial import Record, trace_of

_ENDINGS = (".png", ".pdf", ".svg")
_DOTS_PER_INCH = 150


def draw_figure(name: str, out: Path | None = None, profile: str = "paper", seed: int = 0) -> Path:
    """Draw one of the paper's figures into a file, and return the file's path.

    Whatever is wrong with the request is said before anything is played.

    Args:
        name: a figure of `CATALOGUE`.
        out: file to write, its ending says the format; by default NAME.png here.
        profile: name of the profile to show.
        seed: seed of the trials.
    """
    if name not in CATALOGUE:
        raise ExperimentError(f"The figure {name!r} is unknown: choose from {', '.join(CATALOGUE)}.")
    if seed < 0:
        raise ExperimentError(f"The seed is {seed}: give 0 or more.")
    wanted, used, place = CATALOGUE[name], find_profile(profile), out or Path(f"{name}.png")
    cells = wanted.cells(profile)
    if place.suffix not in _ENDINGS:
        raise ExperimentError(f"The figure {place} has no ending that says its format: use {', '.join(_ENDINGS)}.")
    check_writable("figure", place)
    played, units = _played(cells, seed)
    image = BytesIO()
    wanted.draw(played, units, used).savefig(image, format=place.suffix[1:], dpi=_DOTS_PER_INCH)
    with unwritable_said("figure", place):
        place.write_bytes(image.getvalue())
    return place


def _played(cells: list[Cell], seed: int) -> tuple[Played, tuple[str, ...]]:
    """Play one trial of each cell, with a line that says so."""
    model, console = RobotModel(panda()), Console(stderr=True, highlight=False, soft_wrap=True)
    context = Context(model, paper_skin(model))
    played: Played = []
    for cell in cells:
        experiment = EXPERIMENTS[cell.experiment]
        cost = experiment.cost(cell)
        console.print(f"Playing {cell.name} with seed {seed}: about {cost:g} s of simulated time.", markup=False)
        _, record = experiment.trial(cell, seed, context)
        # every experiment with a figure of the paper keeps its course
        played.append((cell, trace_of(cast(Record, record))))
    return played, context.skin.ids
