"""A path of a class of the user's own, known from where it led."""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from pretouch.types import FloatArray

Tangents = dict[float, tuple[FloatArray, FloatArray]]
"""Point (3,) [m] and unit tangent (3,) of a path, by the arc length [m] of each step that followed it."""


class RecordedPath:
    """A path that is exact at each arc length that was followed, and elsewhere drawn through samples."""

    def __init__(self, samples: FloatArray, length: float, closed: bool, followed: Callable[[], Tangents]) -> None:
        """Take samples (S, 3) [m] at equal arc lengths, and where to find what was followed, once it is needed."""
        self.length, self.closed = length, closed
        self._samples, self._find = samples, followed

    @cached_property
    def _followed(self) -> Tangents:
        return self._find()

    def point(self, phase: float) -> FloatArray:
        """Return the position (3,) [m] at an arc length [m]."""
        found = self._followed.get(phase)
        return self._interpolated(phase) if found is None else found[0]

    def tangent(self, phase: float) -> FloatArray:
        """Return the unit tangent (3,) at an arc length [m]; zero where samples on either side coincide."""
        found = self._followed.get(phase)
        if found is not None:
            return found[1]
        step = self.length / (len(self._samples) - 1)
        along = self._interpolated(phase + step / 2) - self._interpolated(phase - step / 2)
        size = float(np.linalg.norm(along))
        return along / size if size else along

    def _interpolated(self, phase: float) -> FloatArray:
        s = phase % self.length if self.closed else min(max(phase, 0.0), self.length)
        places = np.linspace(0.0, self.length, len(self._samples))
        return np.array([np.interp(s, places, self._samples[:, i]) for i in range(3)])
