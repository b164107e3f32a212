"""Rows of trials brought together by what tells their cells apart."""

from typing import Any

from pretouch_lab.experiment import Row
from pretouch_lab.metrics import spread


def grouped(rows: list[Row], by: tuple[str, ...]) -> list[tuple[Row, list[Row]]]:
    """Rows that share the values of some keys, each group with those values, in the order they first appear in."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in by), []).append(row)
    return [(dict(zip(by, key, strict=True)), group) for key, group in groups.items()]


def cells_of(
    rows: list[Row], by: tuple[str, ...], measures: tuple[str, ...], shares: tuple[str, ...] = (),
    totals: tuple[str, ...] = (),
) -> list[Row]:  # fmt: skip
    """One summary for each cell: spreads of measures, shares of the trials with a flag set, sums of counts.

    A measure that a trial lacks (None) is left out of its spread.
    """
    return [
        {
            **key,
            "trials": len(group),
            **{f"{name}_fraction": round(sum(row[name] for row in group) / len(group), 4) for name in shares},
            **{name: sum(row[name] for row in group) for name in totals},
            **{name: spread([row[name] for row in group if row[name] is not None]) for name in measures},
        }
        for key, group in grouped(rows, by)
    ]
