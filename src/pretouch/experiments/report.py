"""Figures and a page that shows them with the tables, made from a folder of results."""

from html import escape
from pathlib import Path
from string import Template
from typing import Any

from pretouch import __version__
from pretouch.errors import ExperimentError
from pretouch.experiments import avoidance, dynamic, static
from pretouch.experiments.campaign import Request, trace_file
from pretouch.experiments.cell import Cell
from pretouch.experiments.figures import avoidance_figure, dynamic_figure, save, static_figure
from pretouch.experiments.tables import TextTable, tables
from pretouch.experiments.trace import Trace, load_trace
from pretouch.params import profile

_PAGE = Template(
    """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
table { border-collapse: collapse; margin: 1rem 0; font-size: .85rem; }
th, td { border-bottom: 1px solid #ccc; padding: .3rem .6rem; text-align: right; }
th:first-child, td:first-child, th:nth-child(2), td:nth-child(2) { text-align: left; }
img { max-width: 100%; }
.note { color: #555; }
</style>
<h1>$title</h1>
<p>$about</p>
$body
<p class="note">Simulation is not hardware: all of this ran on a simulated Panda whose masses, friction, noise and
delays are errors of the size found on real arms. Pretouch $version.</p>
</html>
"""
)


def write_report(parts: list[tuple[Request, Path]], summary: dict[str, Any], folder: Path) -> Path:
    """Write figures into the folder of each run and one `index.html` for all into `folder`; return the page's path.

    The folders of the runs lie in `folder`, or are it.
    """
    try:
        return _write(parts, summary, folder)
    except OSError as error:
        raise ExperimentError(f"The page cannot be written to {folder}: {error.strerror}: give another.") from error


def _write(parts: list[tuple[Request, Path]], summary: dict[str, Any], folder: Path) -> Path:
    body = [_table(table) for table in tables(summary)]
    about = []
    for request, out in parts:
        for name, text in _figures(request, out):
            source = (out / name).relative_to(folder).as_posix()
            body.append(f'<p><img src="{escape(source)}" alt="{escape(text)}"></p>')
        about.append(
            f"{', '.join(request.experiments)}: {request.seeds} seeds, profiles {', '.join(request.profiles)},"
            f" restrictions {request.restrictions or 'as the experiment has them'},"
            f" static objects of {request.stiffness / 1000:g} N/mm."
        )
    page = folder / "index.html"
    title = "Contact anticipation in simulation"
    text = _PAGE.substitute(
        title=title, about="<br>".join(map(escape, about)), body="\n".join(body), version=__version__
    )
    page.write_text(text, encoding="utf-8")
    return page


def _figures(request: Request, out: Path) -> list[tuple[str, str]]:
    """Draw what the traces of the first seed allow; return file names and descriptions."""
    pictures = []
    shown = next((name for name in reversed(request.profiles) if name != "blind"), request.profiles[-1])
    if static.NAME in request.experiments:
        files = {
            (cell.where["trajectory"], cell.where["side"], cell.profile): trace_file(out, cell, 0)
            for cell in static.cells(request.profiles)
        }
        traces = {key: trace for key, file in files.items() if (trace := _trace(file)) is not None}
        save(static_figure(traces, shown), out / "static.png")
        pictures.append(("static.png", "Force and contact thresholds at the static object"))
    trace = _trace(trace_file(out, Cell(avoidance.NAME, shown, {"place": "beside"}), 0))
    if avoidance.NAME in request.experiments and trace is not None:
        save(avoidance_figure(trace, shown), out / "avoidance.png")
        pictures.append(("avoidance.png", "End-effector path with a hand beside it"))
    trace = _trace(trace_file(out, Cell(dynamic.NAME, shown, {}), 0))
    if dynamic.NAME in request.experiments and trace is not None:
        units = request.context().skin.ids
        figure = dynamic_figure(trace, units, profile(shown).reduction.d_max_m, shown)
        save(figure, out / "dynamic.png")
        pictures.append(("dynamic.png", "Distances, force with thresholds, and velocity over thirty seconds"))
    return pictures


def _trace(file: Path) -> Trace | None:
    """Read a trace, if there is one and it is whole."""
    try:
        return load_trace(file)
    except ExperimentError:
        return None


def _table(table: TextTable) -> str:
    head = "".join(f"<th>{_lines(text)}</th>" for text in table.header)
    rows = "\n".join("<tr>" + "".join(f"<td>{_lines(text)}</td>" for text in row) + "</tr>" for row in table.rows)
    note = f'<p class="note">{escape(table.note)}</p>'
    return f"<h2>{escape(table.title)}</h2>\n<table><tr>{head}</tr>\n{rows}</table>\n{note}"


def _lines(text: str) -> str:
    return escape(text).replace("\n", "<br>")
