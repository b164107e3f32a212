"""Types of arrays, and of the values that each control step makes; shapes stand where arrays are used."""

from dataclasses import dataclass
from typing import NamedTuple, TypeVar, cast, dataclass_transform

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Number = TypeVar("Number", float, FloatArray)


class Below(NamedTuple):
    """Annotates a field with the bound of its numbers' size; a larger number has another unit, or is broken."""

    limit: float


LARGEST = Below(1e3)
"""Bound on desired numbers, joint positions and joint velocities [rad, rad/s, m, m/s]."""
LATEST = Below(1e12)
"""Bound on time stamps [s], wherever the clock starts."""

_FLOAT = np.dtype(np.float64)
WHOLE = np.dtype(np.int64)
"""Type of the numbers in an `IntArray`."""


def real(numbers: object, copy: bool = True) -> FloatArray:
    """Return real numbers as an array of float64, by default a copy; anything else is a TypeError or a ValueError.

    NumPy would take complex numbers, with a warning, and text. A number too large for a float is infinite.
    """
    array = np.array(numbers) if copy else np.asarray(numbers)
    if array.dtype is _FLOAT:
        return array
    if array.dtype.kind not in "biuf":
        raise TypeError(f"numbers of type {array.dtype} are not real")
    with np.errstate(over="ignore"):
        return array.astype(np.float64)


def real_number(number: object) -> float:
    """Return a real number as a float; anything else is a TypeError, a ValueError or an OverflowError."""
    return float(number if isinstance(number, float | int) else real(number)[()])


Class = TypeVar("Class", bound=type)


@dataclass_transform(frozen_default=True)
def value(cls: Class) -> Class:
    """Make a class a dataclass with slots whose fields are set once, at construction.

    The type checker enforces that. Python does not: construction would take three times as long, and a control step
    constructs some twenty values with a hundred fields.
    """
    return cast(Class, dataclass(slots=True)(cls))
