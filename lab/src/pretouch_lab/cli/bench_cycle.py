"""What `pretouch bench cycle` does: measure for each number of points, and show tables."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rich.console import Console

from pretouch.cli.tables import PlainTable
from pretouch.cli.writing import numbers_to
from pretouch.errors import ExperimentError
from pretouch.realtime import check_wishes
from pretouch_lab.benchmarks.cycle import CycleRequest, about, measure
from pretouch_lab.benchmarks.workload import LARGEST_SKIN
from pretouch_lab.run import Row

_SPREAD = {"median": "median_us", "99 %": "p99_us", "99.9 %": "p999_us", "largest": "max_us"}


def bench_cycle(points: tuple[int, ...], request: CycleRequest, json: Path | None = None) -> None:
    """Measure the control step, show what it takes, and write the numbers where `numbers_to` takes `json` to say.

    What was measured before something ended the run is shown and written all the same.
    """
    wrong = [n for n in points if not 1 <= n <= LARGEST_SKIN]
    if wrong or not points:
        raise ExperimentError(f"The number of points is {wrong[0] if wrong else 'missing'}: give 1 to {LARGEST_SKIN}.")
    check_wishes(request.priority, request.cpu)
    with numbers_to(json) as write:
        _measure(points, request, write)


def _measure(points: tuple[int, ...], request: CycleRequest, write: Callable[[Any], None]) -> None:
    rows: list[Row] = []
    said: list[str] = []
    try:
        for n in points:
            seconds = request.cycles / request.rate
            print(f"{n} points: {request.cycles} cycles, {seconds:.0f} s or more.", file=sys.stderr)
            rows.append(measure(n, request, said.append))
    finally:
        if rows:
            missing = list(dict.fromkeys(said))
            # first, for the terminal may be gone
            write({"about": {**about(request), "missing": missing, "asked": points}, "rows": rows})
            _show(rows, request, missing)
        if len(rows) < len(points):
            print(f"Stopped: {len(rows)} of {len(points)} numbers of points were measured.", file=sys.stderr)


def _show(rows: list[Row], request: CycleRequest, missing: list[str]) -> None:
    console = Console(highlight=False)
    title = f"\nTime of a control step, {request.cycles} cycles [us]"
    console.print(title, style="bold", markup=False)
    console.print(_times(rows, request.rate), crop=False)
    console.print(
        "CPU: steps back to back, a reading of each unit 50 times a second; all new: every reading in every step; at a"
        " rate: the processor sleeps between steps, and its caches cool. Overruns: steps that took longer than the"
        " period. Restricting: points within reach of eq. 7, median.\n",
        style="dim", markup=False,
    )  # fmt: skip
    gained = ", ".join(f"{row['memory_gained_kib']} KiB with {row['points']}" for row in rows)
    console.print(f"Memory gained in the run at {request.rate:g} Hz: {gained}.", soft_wrap=True, markup=False)
    for sentence in missing:
        console.print(sentence, soft_wrap=True, markup=False)
    idle = [str(row["points"]) for row in rows if row["tracking"] < 1]
    if idle:
        console.print(f"With {', '.join(idle)} points the arm did not follow its path in every cycle.", markup=False)


def _times(measured: list[Row], rate: float) -> PlainTable:
    rows = []
    runs = {"CPU": "", "CPU, all new": "all_new_", f"CPU at {rate:g} Hz": "at_rate_", f"wall at {rate:g} Hz": "wall_"}
    for row in measured:
        for name, prefix in runs.items():
            took = [f"{row[prefix + key]:.0f}" for key in _SPREAD.values()]
            first = str(row["points"]) if not prefix else ""
            overruns = str(row["overruns"]) if prefix == "wall_" else ""
            restricting = f"{row['restricting_median']:.0f}" if not prefix else ""
            rows.append((first, name, *took, overruns, restricting))
    return PlainTable(("points", "", *_SPREAD, "overruns", "restricting"), rows, left=(1,))
