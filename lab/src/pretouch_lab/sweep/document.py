"""What a sweep leaves for readers: numbers, a figure, tables, and its part of docs/results/sensitivity.md."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from pretouch import __version__
from pretouch.atomic_write import write_json
from pretouch.text_table import Column, TextTable, markdown, tabulated
from pretouch_lab.documents import SENSITIVITY, draw, put, shown
from pretouch_lab.engine import failure_said
from pretouch_lab.experiment import Picture
from pretouch_lab.sweep.indices import indices
from pretouch_lab.sweep.results import write_table
from pretouch_lab.sweep.run import Run
from pretouch_lab.sweep.work import code


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
    with failure_said(run.folder):
        write_json(about, run.folder / "indices.json")
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
    ranges = {one.name: one.written for one in run.sweep.vary}
    names = [*ranges, *(["seed"] if run.sweep.arms > 1 else [])]
    columns: list[Column] = [
        ("parameter", str), ("range", lambda name: ranges.get(name, f"{run.sweep.arms} arms")),
    ]  # fmt: skip
    for metric in run.sweep.metrics:
        of = {row["parameter"]: row for row in about["metrics"][metric]["rows"]}
        if run.sweep.design == "sobol":
            columns += [(f"{metric}:\nfirst", _index(of, "first")), ("total", _index(of, "total"))]
        else:
            columns.append((metric, _correlation(of)))
    return [tabulated(_title(run), columns, names, _note(run, about))]


def _index(rows: dict[str, Any], key: str) -> Callable[[str], str]:
    return lambda name: f"{rows[name][key]:.2f} ± {rows[name][f'{key}_95']:.2f}" if name in rows else "-"


def _correlation(rows: dict[str, Any]) -> Callable[[str], str]:
    def write(name: str) -> str:
        row = rows.get(name)
        return "-" if row is None else f"{row['correlation']:.2f} ({row['low']:.2f} to {row['high']:.2f})"

    return write


def _grid_tables(run: Run, about: dict[str, Any]) -> list[TextTable]:
    def band(k: int) -> Callable[[tuple[dict[str, Any], ...]], str]:
        return lambda rows: _band(rows[k])

    found, made = about["metrics"], []
    for one in run.sweep.vary:
        by_metric = [[r for r in found[m]["rows"] if r["parameter"] == one.name] for m in run.sweep.metrics]
        columns = (
            (one.name, lambda rows: _level(rows[0]["level"])),
            ("n", lambda rows: str(max(r["n"] for r in rows))),
            *((metric, band(k)) for k, metric in enumerate(run.sweep.metrics)),
        )
        made.append(tabulated(_title(run), columns, zip(*by_metric, strict=True), _note(run, about)))
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
        with failure_said(folder):
            draw([drawn], folder)
        places.append(folder / f"{drawn.name}.png")
        if docs:
            put(docs / SENSITIVITY, run.sweep.name, "\n\n".join([shown(drawn), *map(markdown, tables(run, about))]))
            places.append(docs / SENSITIVITY)
    return list(dict.fromkeys(places))
