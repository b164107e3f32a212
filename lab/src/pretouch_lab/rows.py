"""Rows of results: small measures that experiments share, and rows brought together by what tells their cells apart."""

from typing import Any

import numpy as np

from pretouch.types import FloatArray

Row = dict[str, Any]
"""What one trial or several came to, as JSON files hold it."""


def rounded(value: float, digits: int = 3) -> float:
    """Round for a table; what is dropped is far below any error of the measure."""
    return round(float(value), digits)


def peak(values: FloatArray) -> float:
    """Largest value, 0 of none."""
    return float(values.max(initial=0.0))


def angle_deg(a: FloatArray, b: FloatArray) -> float | None:
    """Angle between two vectors (3,) [deg], None if one of them is zero."""
    sizes = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(a @ b / sizes, -1.0, 1.0)))) if sizes > 0 else None


def spread(values: list[float]) -> dict[str, float | int] | None:
    """Median and 10-90 % of some numbers, None of none."""
    if not values:
        return None
    low, middle, high = np.percentile(values, [10, 50, 90])
    return {"median": rounded(middle, 4), "p10": rounded(low, 4), "p90": rounded(high, 4), "n": len(values)}


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
