"""What a run of the detection benchmark leaves for readers: numbers, figures, and a part of a document."""

from pathlib import Path

from pretouch import __version__
from pretouch.text_table import markdown
from pretouch_lab.benchmarks import documents
from pretouch_lab.benchmarks.detection.campaign import NAME, Bench, Rows
from pretouch_lab.benchmarks.detection.contenders import CONTENDERS
from pretouch_lab.benchmarks.detection.results import (
    ablation_rows,
    board_rows,
    contact_rows,
    curves,
    free_rows,
    resolution,
)
from pretouch_lab.benchmarks.detection.tables import detection_tables
from pretouch_lab.benchmarks.documents import shown
from pretouch_lab.benchmarks.store import Row
from pretouch_lab.experiment import Picture

_PICTURES = {
    "bench-detection-curves": "Delay and missed contacts against false alarms; circles: each detector as it is",
    "bench-detection-missed": "Share of contacts missed, by force and duration, all links and kinds of sensing",
}


def summary_of(bench: Bench, rows: Rows) -> Row:
    """Return what the JSON file holds: what was run, a row for each detector and scenario, and the curves."""
    known = CONTENDERS
    return {
        "about": {
            "bench": NAME,
            "version": __version__,
            "quick": bench.quick,
            "seeds": bench.seeds,
            **({"world": bench.world} if bench.world else {}),
        },
        "resolution": resolution(rows),
        "rows": [*free_rows(rows, known), *contact_rows(rows, known), *board_rows(rows, known), *ablation_rows(rows)],
        "curves": curves(rows, known),
    }


def pictures(results: Row, rows: Rows) -> list[Picture]:
    """Draw the figures."""
    from pretouch_lab.benchmarks.detection.figures import curve_figure, missed_figure

    figures = (curve_figure(results, CONTENDERS), missed_figure(rows, CONTENDERS))
    return [Picture(name, text, figure) for (name, text), figure in zip(_PICTURES.items(), figures, strict=True)]


def publish(results: Row, drawn: list[Picture], out: Path, docs: Path | None) -> list[Path]:
    """Write the figures into a run's folder, or a folder of documents, and the part of its document."""
    return documents.publish(NAME, document_part(results, drawn), drawn, out, docs)


def document_part(results: Row, drawn: list[Picture]) -> str:
    """Return the generated part of the document."""
    about = results["about"]
    said = (
        f"Version {about['version']}, {about['seeds']} seeds, {'quick' if about['quick'] else 'full'} run."
        f" {results['resolution']}"
    )
    return "\n\n".join([said, *map(shown, drawn), *map(markdown, detection_tables(results))])
