"""Arrays by what they hold; their shapes stand where they are used."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Number = TypeVar("Number", float, FloatArray)

WHOLE = np.dtype(np.int64)
"""Type of the numbers in an `IntArray`."""
