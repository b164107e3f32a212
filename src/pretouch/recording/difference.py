"""Where two values differ, field by field."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

TOLERANCE = 1e-6
"""Largest difference of a number, in its SI unit, that other versions or another machine may make. Of numbers beyond 1
in size it is that part of them."""

_SENTENCES = frozenset({"reason", "status"})
"""Texts with numbers in them, which rounding may change: compared only where all has to be the same."""


@dataclass(frozen=True)
class Part:
    """One number or text that differs."""

    field: str
    """Where it stands, e.g. `qp.qd[3]`."""
    recorded: Any
    recomputed: Any
    size: float
    """Of the difference, in the field's unit; infinite for what is no number, or is one in one of them only."""


def differing(recorded: Any, recomputed: Any, exact: bool, field: str = "") -> Iterator[Part]:
    """Yield each part of a value that differs: in any bit if `exact`, else by more than `TOLERANCE`.

    NaN is the same as NaN.
    """
    a, b = recorded, recomputed
    if type(a) is not type(b) and not (isinstance(a, float | int) and isinstance(b, float | int)):
        yield Part(field, a, b, math.inf)
    elif is_dataclass(a):
        for f in fields(a):
            if exact or f.name not in _SENTENCES:
                name = f"{field}.{f.name}" if field else f.name
                yield from differing(getattr(a, f.name), getattr(b, f.name), exact, name)
    elif isinstance(a, tuple) and len(a) == len(b):
        for i, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from differing(one, other, exact, f"{field}[{i}]")
    elif isinstance(a, np.ndarray):
        yield from _in_arrays(a, b, exact, field)
    elif isinstance(a, float):
        yield from _in_arrays(np.array(a), np.array(float(b)), exact, field)
    elif a != b:
        yield Part(field, a.value if isinstance(a, Enum) else a, b.value if isinstance(b, Enum) else b, math.inf)


def _in_arrays(a: Any, b: Any, exact: bool, field: str) -> Iterator[Part]:
    """Compare arrays element by element."""
    if a.shape != b.shape:
        yield Part(field, f"shape {a.shape}", f"shape {b.shape}", math.inf)
        return
    if a.dtype != np.float64:
        differ = np.asarray(a != b)
        size = np.where(differ, math.inf, 0.0)
    else:
        with np.errstate(invalid="ignore", over="ignore"):
            size = np.abs(a - b)
        differ = (a != b) | (np.signbit(a) != np.signbit(b)) if exact else size > TOLERANCE * np.maximum(1.0, np.abs(a))
        neither = np.isnan(a) & np.isnan(b)
        one_only = (np.isfinite(a) != np.isfinite(b)) | (~np.isfinite(a) & (a != b))
        differ, size = (differ | one_only) & ~neither, np.where(one_only, math.inf, size)
    for place in np.argwhere(differ):
        at = tuple(place.tolist())
        where = f"{field}[{', '.join(map(str, at))}]" if at else field
        yield Part(where, a[at].item(), b[at].item(), float(size[at]))
