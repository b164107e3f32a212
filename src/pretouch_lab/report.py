"""Figures and a page that shows them with the tables, made from a folder of results."""

from html import escape
from pathlib import Path
from string import Template
from typing import Any

from pretouch import __version__
from pretouch.errors import ExperimentError, PretouchError
from pretouch.text_table import TextTable
from pretouch_lab.campaign import Request, recording_file
from pretouch_lab.cell import Cell
from pretouch_lab.experiment import Experiment, Picture, Row, Sources
from pretouch_lab.registry import GROUPS
from pretouch_lab.trace import Trace, read_trace
from pretouch_lab.worlds import sentence

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
th:first-child, td:first-child, .two th:nth-child(2), .two td:nth-child(2) { text-align: left; }
img { max-width: 100%; }
.note { color: #555; }
</style>
<h1>$title</h1>
<details><summary>What was run</summary><p>$about</p></details>
<ul>
$contents
</ul>
$body
<p class="note">Simulation is not hardware: all of this ran on a simulated Panda whose masses, friction, noise and
delays are errors of the size found on real arms. Pretouch $version.</p>
</html>
"""
)


def write_report(parts: list[tuple[Request, Path]], summary: dict[str, Any], folder: Path) -> Path:
    """Write figures, one `index.html` and the tables as `tables.md` into `folder`; return the page's path.

    `parts` are the runs and their folders, `summary` is that of all of them.
    """
    try:
        return _write(parts, summary, folder)
    except OSError as error:
        raise ExperimentError(f"The page cannot be written to {folder}: {error.strerror}: give another.") from error


def _write(parts: list[tuple[Request, Path]], summary: dict[str, Any], folder: Path) -> Path:
    contents, body, words = [], [], []
    for title, group in GROUPS.items():
        shown = [experiment for experiment in group if experiment.name in summary]
        if shown:
            links = ", ".join(f'<a href="#{e.name}">{e.name}</a>' for e in shown)
            contents.append(f"<li>{escape(title)}: {links}</li>")
            body.append(f"<h2>{escape(title)}</h2>")
        for experiment in shown:
            made = experiment.tables(summary[experiment.name])
            body.append(f'<div id="{experiment.name}">')
            body += [_table(table) for table in made]
            words += [_markdown(table) for table in made]
            body += [*_pictures(parts, experiment, summary[experiment.name], folder), "</div>"]
    body += ["<h2>This implementation</h2>", _picture(_framework(), folder)]
    page = folder / "index.html"
    text = _PAGE.substitute(
        title="Contact anticipation in simulation",
        about="<br>".join(escape(_about(request)) for request, _ in parts),
        contents="\n".join(contents),
        body="\n".join(body),
        version=__version__,
    )
    page.write_text(text, encoding="utf-8")
    (folder / "tables.md").write_text("\n".join(words), encoding="utf-8")
    return page


def _about(request: Request) -> str:
    cells = [cell for cell, _ in request.tasks()]
    profiles = dict.fromkeys(cell.profile for cell in cells)
    modes = dict.fromkeys(str(cell.where["restrictions"]) for cell in cells if "restrictions" in cell.where)
    said = f"{', '.join(request.experiments)}: {request.seeds} seeds, profiles {', '.join(profiles)}"
    said += f", restrictions {', '.join(modes)}." if modes else "."
    return f"{said} {sentence(request.world)}" if request.world else said


def _framework() -> Picture:
    """Draw the framework diagram."""
    from pretouch_lab.paper.figures.framework import framework_figure

    return Picture("framework", "One control step, block by block", framework_figure())


def _picture(picture: Picture, folder: Path) -> str:
    file = f"{picture.name}.png"
    picture.figure.savefig(folder / file, dpi=120)
    return f'<p><img src="{escape(file)}" alt="{escape(picture.text)}"></p>'


def _pictures(parts: list[tuple[Request, Path]], experiment: Experiment, summary: Row, folder: Path) -> list[str]:
    """Draw what an experiment's recordings of the first seed and its summary allow; return it as HTML."""
    sources = Sources(summary, lambda cell: find_trace([out for _, out in parts], cell), parts[0][0].context().skin.ids)
    return [_picture(picture, folder) for picture in experiment.draw(sources)]


def find_trace(folders: list[Path], cell: Cell) -> Trace | None:
    """Read the course of a cell's trial with the first seed from one of some folders, if it is there and whole."""
    for folder in folders:
        try:
            return read_trace(recording_file(folder, cell, 0))[0]
        except PretouchError:
            continue
    return None


def _table(table: TextTable) -> str:
    head = "".join(f"<th>{_lines(text)}</th>" for text in table.header)
    rows = "\n".join("<tr>" + "".join(f"<td>{_lines(text)}</td>" for text in row) + "</tr>" for row in table.rows)
    note = f'<p class="note">{escape(table.note)}</p>'
    kind = ' class="two"' if table.names > 1 else ""
    return f"<h3>{escape(table.title)}</h3>\n<table{kind}><tr>{head}</tr>\n{rows}</table>\n{note}"


def _markdown(table: TextTable) -> str:
    lines = [f"## {table.title}", "", _markdown_row(table.header), _markdown_row(("---",) * len(table.header))]
    return "\n".join([*lines, *map(_markdown_row, table.rows), "", table.note, ""])


def _markdown_row(texts: tuple[str, ...]) -> str:
    cells = (text.replace("|", "\\|").replace("\n", "<br>") for text in texts)
    return f"| {' | '.join(cells)} |"


def _lines(text: str) -> str:
    return escape(text).replace("\n", "<br>")
