"""Rows as tables: groups, quantiles, exact bounds, ratios to a baseline, and columns declared as values."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pretouch.text_table import TextTable
from pretouch.types import FloatArray
from pretouch_lab.run import Row


def rounded(value: float, digits: int = 3) -> float:
    """Round for a table; the lost digits are far below the error of any measure."""
    return round(float(value), digits)


def peak(values: FloatArray) -> float:
    """Largest value, 0 without values."""
    return float(values.max(initial=0.0))


def spread(values: Iterable[float | None]) -> Row | None:
    """Return median and 10-90 % of the values that are not None; None without such values.

    Times without an end are infinite. Quantiles are then the nearest values, and infinite quantiles become None.
    """
    some = np.array([value for value in values if value is not None], np.float64)
    if not len(some):
        return None
    quantiles = np.percentile(some, [50, 10, 90], method="nearest" if np.isinf(some).any() else "linear")
    median, low, high = map(finite, quantiles)
    return {"median": median, "p10": low, "p90": high, "n": len(some)}


def finite(value: float) -> float | None:
    """Return a number for JSON; infinite and NaN become None."""
    return rounded(value, 4) if np.isfinite(value) else None


def grouped(rows: Iterable[Row], by: Sequence[str]) -> list[tuple[Row, list[Row]]]:
    """Return groups of rows with equal values of some names, each with these values, in order of first appearance."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row.get(name) for name in by), []).append(row)
    return [(dict(zip(by, key, strict=True)), group) for key, group in groups.items()]


def summary(rows: Iterable[Row], by: Sequence[str], spreads: Sequence[str], totals: Sequence[str] = ()) -> list[Row]:
    """Return a row for each group: `trials`, spreads of measures, sums of counts and flags. None is left out."""
    return [
        {
            **key,
            "trials": len(group),
            **{name: spread(row[name] for row in group) for name in spreads},
            **{name: sum(row[name] or 0 for row in group) for name in totals},
        }
        for key, group in grouped(rows, by)
    ]


def ratios(
    rows: Iterable[Row], to: Mapping[str, Any], same: Sequence[str], measures: Sequence[str], inverse: bool = False
) -> list[Row]:
    """Return rows with `NAME_ratio`: each measure over that of the row's twin, None where either is None or zero.

    Args:
        rows: of trials.
        to: values that mark the twins.
        same: names whose values a row and its twin share, the seed among them.
        measures: names of the measures.
        inverse: divide the twin's measure by the row's.
    """
    every = list(rows)
    twins = {tuple(row[name] for name in same): row for row in every if to.items() <= row.items()}

    def ratio(row: Row, twin: Row | None, name: str) -> float | None:
        if twin is None or not row[name] or not twin[name]:
            return None
        return float(twin[name] / row[name] if inverse else row[name] / twin[name])

    return [
        row | {f"{name}_ratio": ratio(row, twins.get(tuple(row[key] for key in same)), name) for name in measures}
        for row in every
    ]


def share_above(events: int, of: int) -> float:
    """95 % lower bound, one-sided, on a share with `events` counted among `of` (Clopper and Pearson)."""
    from scipy.stats import binomtest

    return float(binomtest(events, of, alternative="greater").proportion_ci(0.95, "exact").low)


def rate_bounds(events: float, hours: float, dispersion: float = 1.0) -> tuple[float, float]:
    """95 % bounds on a rate [1/h] with `events` counted in `hours`: exact for a Poisson count (Garwood).

    Counts whose variance is `dispersion` times that of Poisson counts weigh as `events / dispersion` Poisson events.
    """
    from scipy.stats import chi2

    effective, time = events / dispersion, hours / dispersion
    low = chi2.ppf(0.025, 2 * effective) / 2 if effective else 0.0
    return float(low / time), float(chi2.ppf(0.975, 2 * effective + 2) / 2 / time)


def dispersion_of(counts: Sequence[int]) -> float:
    """Variance of counts over their mean, at least 1: Poisson counts have 1."""
    mean = float(np.mean(counts)) if counts else 0.0
    return max(1.0, float(np.var(counts, ddof=1)) / mean) if len(counts) > 1 and mean > 0 else 1.0


@dataclass(frozen=True)
class Column:
    """One column of a table: a value of each row and its format."""

    heading: str
    """With the unit."""
    key: str
    """Name of the value: a text, a number, or a `spread` whose median is shown."""
    digits: int | None = None
    """Digits behind the point; None: the value unchanged."""
    factor: float = 1.0
    band: bool = False
    """True to show 10-90 % of a spread of several values below its median."""
    of: str = ""
    """Name of the total of a count."""
    second: str = ""
    """Name of a text to show below the value."""

    def text(self, row: Row) -> str:
        """Return the cell of a row: a dash for None, `>` for a time without an end."""
        value = row[self.key]
        main = "-" if value is None else self._spread(value) if isinstance(value, dict) else self._number(value)
        return (
            main
            + (f"/{row[self.of]}" if self.of and value is not None else "")
            + (f"\n{row[self.second]}" if self.second else "")
        )

    def _spread(self, value: Row) -> str:
        middle = self._number(value["median"])
        if not self.band or value["n"] == 1:
            return middle
        high = value["p90"]
        few = self.digits if high is None else 0 if self.factor * high >= 10 else min(self.digits or 0, 2)
        return f"{middle}\n{self._number(value['p10'], few)}-{self._number(high, few)}"

    def _number(self, value: Any, digits: int | None = None) -> str:
        if value is None:
            return ">"
        digits = self.digits if digits is None else digits
        # + 0.0 removes the minus of a zero
        return str(value) if digits is None else f"{round(self.factor * value, digits) + 0.0:.{digits}f}"


def table(title: str, columns: Sequence[Column], rows: Iterable[Row], note: str = "", names: int = 1) -> TextTable:
    """Return a table with a line for each row; the first `names` columns hold names."""
    cells = tuple(tuple(column.text(row) for column in columns) for row in rows)
    return TextTable(title, tuple(column.heading for column in columns), cells, note, names)


def medians(
    title: str, columns: Sequence[Column], rows: Iterable[Row], by: Sequence[str], note: str = "", names: int = 1
) -> TextTable:
    """Return a table of groups of trials: medians in columns with digits, sums in the others."""
    spreads = [column.key for column in columns if column.digits is not None]
    counts = {key for column in columns if column.digits is None for key in (column.key, column.of)}
    return table(title, columns, summary(rows, by, spreads, [*counts - {"", "trials", *by}]), note, names)


def short(value: float) -> str:
    """Return a number with two significant digits."""
    return f"{value:.2g}" if value < 9.95 else f"{value:.0f}"
