"""Where a sweep keeps its cells: one file each, whole or not there, named by a digest of all that decides it."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pretouch.atomic_write import write_json
from pretouch.checks import is_number
from pretouch_lab.sweep.measures import Measure
from pretouch_lab.sweep.work import Cell, Job

LARGEST_ANSWER = 10_000_000
"""Characters of a worker's answer that are looked at."""
_LARGEST_REASON = 1000


@dataclass(frozen=True)
class Result:
    """What is known of one cell."""

    metrics: dict[str, float | None] | None
    """None where it failed."""
    reason: str
    """Why it failed, empty where it did not."""
    seconds: float


class Damaged(Exception):
    """What was read is not what a worker writes."""


class Store:
    """The cells of one sweep in a folder."""

    def __init__(self, folder: Path, what: Measure) -> None:
        """Take a folder for cells of an experiment; it is made when the first is written."""
        self._folder, self._what = folder, what

    def file(self, key: str) -> Path:
        """Return where a cell is kept."""
        return self._folder / f"{key}.json"

    def read(self, cell: Cell) -> Result | None:
        """Return what is known of a cell, None if nothing is. Raises Damaged for a file that holds something else."""
        try:
            text = self.file(cell.key).read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as error:
            raise Damaged(str(error)) from error
        row = _object(text)
        if row.get("values") != cell.values or row.get("seed") != cell.seed:
            raise Damaged("it is of another cell")
        return self._checked(row)

    def keep(self, cell: Cell, result: Result) -> None:
        """Write a cell's file, whole or not at all. Raises OSError."""
        self._folder.mkdir(parents=True, exist_ok=True)
        row = {
            "experiment": self._what.name, "values": cell.values, "seed": cell.seed, "metrics": result.metrics,
            "reason": result.reason, "seconds": result.seconds,
        }  # fmt: skip
        write_json(row, self.file(cell.key))

    def answered(self, job: Job, answer: object) -> list[tuple[Cell, Result]]:
        """Read a worker's answer, which is data from elsewhere: anything but numbers for these cells is refused.

        Cells that it does not tell of, and all of an answer that cannot be read, count as failed.
        """
        try:
            if not isinstance(answer, str) or len(answer) > LARGEST_ANSWER:
                raise Damaged("it is no text, or too long")
            rows = _loaded(answer)
            if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
                raise Damaged("it is no list of results")
        except Damaged as error:
            return [(cell, _failed(f"The worker's answer cannot be read: {error}")) for cell in job.cells]
        by_key = {row.get("key"): row for row in rows if isinstance(row.get("key"), str)}
        found = []
        for cell in job.cells:
            try:
                result = self._checked(
                    by_key.get(cell.key, {"reason": "The worker did not tell of it.", "seconds": 0.0})
                )
            except Damaged as error:
                result = _failed(f"The worker's answer cannot be read: {error}")
            found.append((cell, result))
        return found

    def _checked(self, row: dict[str, Any]) -> Result:
        metrics, reason, seconds = row.get("metrics"), row.get("reason") or "", row.get("seconds", -1.0)
        if not is_number(seconds) or float(seconds) < 0:
            raise Damaged("it says not how long it took")
        if metrics is None:
            if not isinstance(reason, str) or not reason:
                raise Damaged("it holds neither numbers nor a reason")
            return Result(None, reason[:_LARGEST_REASON], float(seconds))
        if not isinstance(metrics, dict) or set(metrics) != set(self._what.metrics):
            raise Damaged(f"it does not hold the numbers of {self._what.name}")
        if not all(value is None or is_number(value) for value in metrics.values()):
            raise Damaged("it holds something else than numbers")
        ordered = {name: None if metrics[name] is None else float(metrics[name]) for name in self._what.metrics}
        return Result(ordered, "", float(seconds))


def _failed(reason: str) -> Result:
    return Result(None, reason, 0.0)


def _loaded(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise Damaged(str(error)) from error


def _object(text: str) -> dict[str, Any]:
    found = _loaded(text)
    if not isinstance(found, dict):
        raise Damaged("it holds no object")
    return found
