"""What `pretouch figure` does: one of the paper's figures, from a recorded run or from trials played for it."""

import json
import os
from io import BytesIO
from pathlib import Path
from typing import cast

from rich.console import Console

from pretouch.cli.writing import check_writable, unwritable_said
from pretouch.errors import ExperimentError
from pretouch.experiments.campaign import trace_file
from pretouch.experiments.cell import Cell, Context
from pretouch.experiments.figures.catalogue import CATALOGUE, Played
from pretouch.experiments.registry import EXPERIMENTS
from pretouch.experiments.trace import load_trace, trace_of
from pretouch.experiments.trial import Record
from pretouch.params import profile as find_profile
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import load_skin, paper_skin

_ENDINGS = (".png", ".pdf", ".svg")
_DOTS_PER_INCH = 150


def draw_figure(
    name: str, run: Path | None = None, out: Path | None = None, profile: str = "paper", seed: int = 0
) -> Path:
    """Draw one of the paper's figures into a file, and return the file's path.

    Whatever is wrong with the request is said before anything is played.

    Args:
        name: a figure of `CATALOGUE`.
        run: folder of `pretouch reproduce` or `pretouch demo` with the traces; without one the trials are played.
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
    played, units = _recorded(cells, run, seed) if run and cells else _played(cells, seed)
    image = BytesIO()
    wanted.draw(played, units, used).savefig(image, format=place.suffix[1:], dpi=_DOTS_PER_INCH)
    with unwritable_said("figure", place):
        place.write_bytes(image.getvalue())
    return place


def _recorded(cells: list[Cell], run: Path, seed: int) -> tuple[Played, tuple[str, ...]]:
    """Read the traces of some cells from a run's folder or the folders in it, and the names of the skin's units."""
    try:
        folders = [run, *sorted(folder for folder in run.iterdir() if folder.is_dir())]
    except OSError as error:
        raise ExperimentError(
            f"The run {run} cannot be read ({error.strerror}): give a folder of pretouch reproduce or pretouch demo."
        ) from error
    homes = [next((f for f in folders if os.path.isfile(trace_file(f, cell, seed))), None) for cell in cells]
    played: Played = []
    for cell, home in zip(cells, homes, strict=True):
        if home is None:
            profiles = ",".join(dict.fromkeys(cell.profile for cell in cells))
            raise ExperimentError(
                f"The run {run} has no trace of {cell.name} with seed {seed} (runs keep those of seed 0): `pretouch"
                f" reproduce {cell.experiment} --seeds 1 --profiles {profiles}` makes it, or leave out --run."
            )
        played.append((cell, load_trace(trace_file(home, cell, seed))))
    units = _units(homes[0] or run)
    if any(trace.range_distance.shape[1] != len(units) for _, trace in played):
        raise ExperimentError(
            f"The traces of the run {run} are of another skin than its run.json says: leave out --run."
        )
    return played, units


def _units(folder: Path) -> tuple[str, ...]:
    """Names of the units of the skin that a run had."""
    about, model = folder / "run.json", RobotModel(panda())
    try:
        skin = dict(json.loads(about.read_text(encoding="utf-8")))["skin"]
        path = None if skin is None else Path(skin)
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ExperimentError(f"The file {about} cannot be read ({error}): give another --run.") from error
    return (load_skin(path, model) if path else paper_skin(model)).ids


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
