"""How sure a median and a share are, and how such numbers are written."""

from typing import Any

import numpy as np


def median_bounds(values: list[float]) -> tuple[float, float]:
    """95 % bounds on a median: those of the sorted values between which it lies, whatever they are distributed like."""
    from scipy.stats import binom

    found = np.sort(values)
    low = max(int(binom.ppf(0.025, len(found), 0.5)) - 1, 0)
    return float(found[low]), float(found[len(found) - 1 - low])


def share_below(misses: int, of: int) -> float:
    """95 % upper bound on a share of which so many of so many were counted (Clopper and Pearson)."""
    from scipy.stats import beta

    return 1.0 if misses >= of else float(beta.ppf(0.975, misses + 1, of - misses))


def rate_bounds(events: float, hours: float, dispersion: float = 1.0) -> tuple[float, float]:
    """95 % bounds on a rate [1/h] of which `events` were counted in some hours: exact for a Poisson count (Garwood).

    Where counts scatter `dispersion` times as much as Poisson counts do, so many events tell as much as one.
    """
    from scipy.stats import chi2

    effective, time = events / dispersion, hours / dispersion
    low = chi2.ppf(0.025, 2 * effective) / 2 if effective else 0.0
    return float(low / time), float(chi2.ppf(0.975, 2 * effective + 2) / 2 / time)


def dispersion_of(counts: list[int]) -> float:
    """Variance of counts by their mean, 1 for Poisson counts and taken as 1 where it is less or unknown."""
    mean = float(np.mean(counts)) if counts else 0.0
    return max(1.0, float(np.var(counts, ddof=1)) / mean) if len(counts) > 1 and mean > 0 else 1.0


def short(value: float) -> str:
    """Write a number with two digits that count."""
    return f"{value:.2g}" if value < 9.95 else f"{value:.0f}"


def finite(value: float) -> Any:
    """Return a number as JSON may hold it: what never ended is None."""
    return round(float(value), 4) if np.isfinite(value) else None
