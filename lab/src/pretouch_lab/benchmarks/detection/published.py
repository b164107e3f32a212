"""What a run of the detection benchmark leaves for readers: numbers, figures, and a part of a document."""

from pretouch_lab.baselines.detection import BASELINES
from pretouch_lab.benchmarks.bench import Bench, Found, said
from pretouch_lab.benchmarks.detection.results import (
    Rows,
    ablation_rows,
    board_rows,
    contact_rows,
    curves,
    free_rows,
    hard_rows,
    resolution,
)
from pretouch_lab.benchmarks.detection.tables import detection_tables
from pretouch_lab.experiment import Picture
from pretouch_lab.rows import Row

_PICTURES = {
    "bench-detection-curves": "Delay and missed contacts against false alarms; circles: each detector as it is",
    "bench-detection-missed": "Share of contacts missed, by force and duration, all links and kinds of sensing",
}


def found(bench: Bench, rows: Rows) -> Found:
    """Return what a run came to: a row for each detector and scenario, and the curves."""
    from pretouch_lab.benchmarks.detection.figures import curve_figure, missed_figure

    results = summary_of(bench, rows)
    figures = (curve_figure(results, BASELINES), missed_figure(rows, BASELINES))
    pictures = [Picture(name, text, figure) for (name, text), figure in zip(_PICTURES.items(), figures, strict=True)]
    text = f"{said(results['about'])} {results['resolution']}"
    return Found(results, detection_tables(results), results["resolution"], pictures, text)


def summary_of(bench: Bench, rows: Rows) -> Row:
    """Return what the JSON file holds: what was run, a row for each detector and scenario, and the curves."""
    known = BASELINES
    return {
        "about": bench.about(),
        "resolution": resolution(rows),
        "rows": [
            *free_rows(rows, known), *contact_rows(rows, known), *hard_rows(rows, known), *board_rows(rows, known),
            *ablation_rows(rows),
        ],
        "curves": curves(rows, known),
    }  # fmt: skip
