"""What a sweep leaves for readers: numbers, a figure, tables, and its part of docs/results/sensitivity.md."""

from pathlib import Path
from typing import Any

from pretouch import __version__
from pretouch.atomic_write import write_json
from pretouch.text_table import TextTable, markdown
from pretouch_lab.benchmarks.documents import put, shown
from pretouch_lab.experiment import Picture
from pretouch_lab.sweep.indices import indices
from pretouch_lab.sweep.results import write_table
from pretouch_lab.sweep.run import Run
from pretouch_lab.sweep.store import unwritable
from pretouch_lab.sweep.work import code

DOCUMENT = "results/sensitivity.md"
"""In a folder of documents."""


def written(run: Run) -> dict[str, Any]:
    """Write a sweep's table and indices into its folder, and return the latter."""
    found = indices(run)
    played = [r for cell in {c.key: c for c in run.cells}.values() if (r := run.results.get(cell.key))]
    about = {
        "version": __version__, "code": code(run.sweep.experiment), "sweep": run.sweep.described(),
        "points": len(run.points), "cells": len({cell.key for cell in run.cells}), "failed": len(run.failed),
        "processor_s": round(sum(r.seconds for r in played), 1), "metrics": found,
    }  # fmt: skip
    write_table(run, run.folder / "results.parquet")
    try:
        write_json(about, run.folder / "indices.json")
    except OSError as error:
        raise unwritable(run.folder, error) from error
    return about


def picture(run: Run, about: dict[str, Any]) -> Picture:
    """Draw a sweep's figure."""
    from pretouch_lab.sweep.figure import sweep_figure

    kind = {
        "sobol": "first-order and total indices", "lhs": "rank correlations", "grid": "course over the grid",
    }[run.sweep.design]  # fmt: skip
    text = f"{run.sweep.text or run.sweep.name}: {kind}"
    return Picture(f"sweep-{run.sweep.name}", text, sweep_figure(run.sweep, about["metrics"]))


def tables(run: Run, about: dict[str, Any]) -> list[TextTable]:
    """Return a sweep's tables: one of all metrics for indices and correlations, one for each parameter of a grid."""
    if run.sweep.design == "grid":
        return _grid_tables(run, about)
    sobol, found = run.sweep.design == "sobol", about["metrics"]
    ranges = {one.name: one.written for one in run.sweep.vary}
    header = ["parameter", "range"]
    for metric in run.sweep.metrics:
        header += [f"{metric}:\nfirst", "total"] if sobol else [metric]
    names = [*ranges, *(["seed"] if run.sweep.arms > 1 else [])]
    lines = []
    for name in names:
        line = [name, ranges.get(name, f"{run.sweep.arms} arms")]
        for metric in run.sweep.metrics:
            row = next((r for r in found[metric]["rows"] if r["parameter"] == name), None)
            line += _numbers(row, sobol)
        lines.append(tuple(line))
    return [TextTable(_title(run), tuple(header), tuple(lines), _note(run, about))]


def _numbers(row: dict[str, Any] | None, sobol: bool) -> list[str]:
    if row is None:
        return ["-", "-"] if sobol else ["-"]
    if sobol:
        return [f"{row[k]:.2f} ± {row[f'{k}_95']:.2f}" for k in ("first", "total")]
    return [f"{row['correlation']:.2f} ({row['low']:.2f} to {row['high']:.2f})"]


def _grid_tables(run: Run, about: dict[str, Any]) -> list[TextTable]:
    found, made = about["metrics"], []
    for one in run.sweep.vary:
        by_metric = [[r for r in found[m]["rows"] if r["parameter"] == one.name] for m in run.sweep.metrics]
        lines = tuple(
            (_level(rows[0]["level"]), str(max(r["n"] for r in rows)), *map(_band, rows))
            for rows in zip(*by_metric, strict=True)
        )
        made.append(TextTable(_title(run), (one.name, "n", *run.sweep.metrics), lines, _note(run, about)))
    return made


def _level(level: object) -> str:
    return f"{level:g}" if isinstance(level, float) else str(level)


def _band(row: dict[str, Any]) -> str:
    return "-" if row["median"] is None else f"{row['median']:.3g} ({row['p10']:.3g} to {row['p90']:.3g})"


def _title(run: Run) -> str:
    return f"{run.sweep.text or run.sweep.name} ({run.sweep.measure.name}: {run.sweep.measure.text})"


def _note(run: Run, about: dict[str, Any]) -> str:
    sweep, said = run.sweep, []
    if sweep.fixed:
        said.append(f"Fixed: {', '.join(f'{name} = {value}' for name, value in sweep.fixed.items())}.")
    for metric in sweep.metrics:
        found = about["metrics"][metric]
        if found.get("median") is not None:
            whole = (
                f"{found['blocks']} of {found['of']} blocks" if "blocks" in found
                else f"{found['points']} of {found['of']} points"
            )  # fmt: skip
            said.append(
                f"{metric}: {sweep.measure.metrics[metric]}, mean {found['mean']:.3g}, median {found['median']:.3g},"
                f" 10 to 90 %: {found['p10']:.3g} to {found['p90']:.3g}; {whole} have it."
            )
        else:
            said.append(f"{metric}: {sweep.measure.metrics[metric]}; there is none.")
    if sweep.design == "sobol" and sweep.ranks:
        said.append(f"Indices are those of the ranks of {', '.join(sweep.ranks)}.")
    failed = f", {about['failed']} failed" if about["failed"] else ""
    missing = about["cells"] - len({c.key for c in run.cells} & set(run.results))
    left = f", {missing} not played" if missing else ""
    said.append(
        f"Profile {sweep.profile}, {sweep.design}, {about['cells']} cells{failed}{left}, {sweep.arms} arms of the"
        f" {sweep.seeds} seeds, {about['processor_s'] / 60:.1f} min of a processor, version {about['version']}."
    )
    return " ".join(said)


def publish(runs: list[tuple[Run, dict[str, Any]]], out: Path, docs: Path | None) -> list[Path]:
    """Write all figures into the sweeps' folders, or with `docs` into its images and their parts of the document."""
    places: list[Path] = []
    for run, about in runs:
        drawn = picture(run, about)
        folder = docs / "images" if docs else run.folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
            drawn.figure.savefig(folder / f"{drawn.name}.png", dpi=120)
        except OSError as error:
            raise unwritable(folder, error) from error
        places.append(folder / f"{drawn.name}.png")
        if docs:
            put(docs / DOCUMENT, run.sweep.name, "\n\n".join([shown(drawn), *map(markdown, tables(run, about))]))
            places.append(docs / DOCUMENT)
    return list(dict.fromkeys(places))
