"""Figures and tables, made from a folder of results."""

from pathlib import Path
from typing import Any

from pretouch.errors import ExperimentError, PretouchError
from pretouch.recording.run_record import RunRecord
from pretouch.text_table import markdown
from pretouch_lab.campaign import Request, recording_file
from pretouch_lab.cell import Cell
from pretouch_lab.experiment import Picture, Sources, draw
from pretouch_lab.registry import EXPERIMENTS
from pretouch_lab.trial import read_trace


def write_report(parts: list[tuple[Request, Path]], summary: dict[str, Any], folder: Path) -> Path:
    """Write figures and the tables as `tables.md` into `folder`; return the path of the tables.

    `parts` are the runs and their folders, `summary` is that of all of them.
    """
    units, written = parts[0][0].context().skin.ids, []
    for name, experiment in EXPERIMENTS.items():
        if name in summary:
            sources = Sources(summary[name], lambda cell: find_trace([out for _, out in parts], cell), units)
            written += [markdown(table, 2) for table in experiment.tables(summary[name])]
            written += _drawn(experiment.draw(sources), folder)
    place = folder / "tables.md"
    try:
        place.write_text("\n".join(written), encoding="utf-8")
    except OSError as error:
        raise ExperimentError(f"The tables cannot be written to {folder}: {error.strerror}: give another.") from error
    return place


def _drawn(pictures: list[Picture], folder: Path) -> list[str]:
    """Write figures into a folder; return what shows them in a document there."""
    try:
        draw(pictures, folder)
    except OSError as error:
        raise ExperimentError(f"Figures cannot be written to {folder}: {error.strerror}: give another.") from error
    return [f"![{picture.text}]({picture.name}.png)\n" for picture in pictures]


def find_trace(folders: list[Path], cell: Cell) -> RunRecord | None:
    """Read the course of a cell's trial with the first seed from one of some folders, if it is there and whole."""
    for folder in folders:
        try:
            return read_trace(recording_file(folder, cell, 0))[0]
        except PretouchError:
            continue
    return None
