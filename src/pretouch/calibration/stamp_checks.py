"""What stamps tell of a clock."""

import numpy as np

from pretouch.types import FloatArray

_SPARSE = 100
"""Stamps that span more than this many times the time their samples take are not all of one clock."""


def median_period(stamp: FloatArray) -> float:
    """Return the median time between stamps (M,), two at least [s]."""
    return float(np.median(np.diff(stamp)))


def of_several_clocks(stamp: FloatArray) -> bool:
    """Tell whether stamps (M,), two at least, are spread over far more time than so many samples take [s]."""
    return float(np.ptp(stamp)) > _SPARSE * median_period(stamp) * len(stamp)
