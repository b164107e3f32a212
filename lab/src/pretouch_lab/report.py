"""Figures and a page that shows them with the tables, made from a folder of results."""

from html import escape
from pathlib import Path
from typing import Any

from pretouch.errors import ExperimentError, PretouchError
from pretouch.recording.run_record import RunRecord
from pretouch.reporting.html import Html, document, element, joined, titled_table
from pretouch.text_table import markdown
from pretouch_lab.campaign import Request, recording_file
from pretouch_lab.cell import Cell
from pretouch_lab.domain_randomisation import sentence
from pretouch_lab.experiment import Experiment, Picture, Sources
from pretouch_lab.registry import GROUPS
from pretouch_lab.rows import Row
from pretouch_lab.trace import read_trace

_TITLE = "Contact anticipation in simulation"
_NOTE = (
    "Simulation is not hardware: all of this ran on a simulated Panda whose masses, friction, noise and delays are"
    " errors of the size found on real arms."
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
    contents: list[Html] = []
    front: list[Html] = []
    sections: list[Html] = []
    words: list[str] = []
    for title, group in GROUPS.items():
        shown = [experiment for experiment in group if experiment.name in summary]
        if not shown:
            continue
        links = joined((Html(f'<a href="#{e.name}">{e.name}</a>') for e in shown), ", ")
        contents.append(element("li", joined([f"{title}: ", links], "")))
        parts_of: list[Html] = [element("h2", title)]
        for experiment in shown:
            made = experiment.tables(summary[experiment.name])
            words += [markdown(table, 2) for table in made]
            drawn = _pictures(parts, experiment, summary[experiment.name], folder)
            said = experiment.conclude(summary[experiment.name])
            if said:
                front += [element("p", said, "summary"), *drawn[:1]]
                drawn = drawn[1:]
            parts_of.append(element("div", joined([*map(titled_table, made), *drawn]), anchor=experiment.name))
        sections.append(element("section", joined(parts_of)))
    own = [element("h2", "This implementation"), _picture(_framework(), folder)]
    ran = element("summary", "What was run") + element("p", joined((_about(request) for request, _ in parts), "<br>"))
    head = [element("h1", _TITLE), *front, element("ul", joined(contents)), element("details", Html(ran))]
    page = folder / "index.html"
    page.write_text(document(_TITLE, joined([*head, *sections, element("section", joined(own))]), _NOTE), "utf-8")
    (folder / "tables.md").write_text("\n".join(words), encoding="utf-8")
    return page


def _about(request: Request) -> str:
    cells = [cell for cell, _ in request.trials()]
    profiles = dict.fromkeys(cell.profile for cell in cells)
    modes = dict.fromkeys(str(cell.where["restrictions"]) for cell in cells if "restrictions" in cell.where)
    said = f"{', '.join(request.experiments)}: {request.seeds} seeds, profiles {', '.join(profiles)}"
    said += f", restrictions {', '.join(modes)}." if modes else "."
    return f"{said} {sentence(request.world)}" if request.world else said


def _framework() -> Picture:
    """Draw the framework diagram."""
    from pretouch_lab.paper.figures.framework import framework_figure

    return Picture("framework", "One control step, block by block", framework_figure())


def _picture(picture: Picture, folder: Path) -> Html:
    file = f"{picture.name}.png"
    picture.figure.savefig(folder / file, dpi=120)
    return element("figure", Html(f'<img src="{escape(file)}" alt="{escape(picture.text)}">'))


def _pictures(parts: list[tuple[Request, Path]], experiment: Experiment, summary: Row, folder: Path) -> list[Html]:
    """Draw what an experiment's recordings of the first seed and its summary allow; return it as HTML."""
    sources = Sources(summary, lambda cell: find_trace([out for _, out in parts], cell), parts[0][0].context().skin.ids)
    return [_picture(picture, folder) for picture in experiment.draw(sources)]


def find_trace(folders: list[Path], cell: Cell) -> RunRecord | None:
    """Read the course of a cell's trial with the first seed from one of some folders, if it is there and whole."""
    for folder in folders:
        try:
            return read_trace(recording_file(folder, cell, 0))[0]
        except PretouchError:
            continue
    return None
