"""What a sweep leaves: one Parquet file with a row for each point of its design."""

import json
from pathlib import Path

import numpy as np

from pretouch import __version__
from pretouch.atomic_write import atomic_replacement
from pretouch.types import FloatArray
from pretouch_lab.engine import failure_said
from pretouch_lab.sweep.design import SEED
from pretouch_lab.sweep.run import Run
from pretouch_lab.sweep.work import code


def values_of(run: Run, metric: str) -> FloatArray:
    """Return a number (points,) of each point, NaN where there is none."""
    found = np.full(len(run.points), np.nan)
    for i, cell in enumerate(run.cells):
        result = run.results.get(cell.key)
        value = None if result is None or result.metrics is None else result.metrics[metric]
        found[i] = np.nan if value is None else value
    return found


def write_table(run: Run, path: Path) -> None:
    """Write all points with their numbers, whole or not at all.

    Columns: each parameter that is varied, `seed`, each number measured (null where there is none), `seconds`,
    `status` (ok, failed, missing) and `reason`. The file's metadata hold the sweep's definition as JSON, under
    `pretouch`.
    """
    import pyarrow as pa
    from pyarrow import parquet

    results = [run.results.get(cell.key) for cell in run.cells]
    columns: dict[str, list[object]] = {
        one.name: [point.values[one.name] for point in run.points] for one in run.sweep.vary
    }
    columns[SEED] = [point.seed for point in run.points]
    for name in run.sweep.measure.metrics:
        columns[name] = [r.metrics[name] if r and r.metrics else None for r in results]
    columns["seconds"] = [r.seconds if r else None for r in results]
    columns["status"] = [("ok" if r.metrics is not None else "failed") if r else "missing" for r in results]
    columns["reason"] = [r.reason if r else "" for r in results]
    types = dict.fromkeys(run.sweep.measure.metrics, pa.float64()) | {"seconds": pa.float64()}
    about = json.dumps({"version": __version__, "code": code(run.sweep.experiment), "sweep": run.sweep.described()})
    arrays = {name: pa.array(values, types.get(name)) for name, values in columns.items()}
    table = pa.table(arrays).replace_schema_metadata({"pretouch": about})
    with failure_said(path), atomic_replacement(path) as unfinished:
        parquet.write_table(table, unfinished)
