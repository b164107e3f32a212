"""What became of a push: detected or not, and if not, what it lacked. From the fields of the steps alone."""

import numpy as np

from pretouch.explanation import answers
from pretouch.types import ControlStep, FloatArray, Mode

_GRACE_S = 0.3
"""A contact this long after the end of a push is still of it [s]: the estimate lags."""
_SAME = 1e-6
"""Difference of shares below which the detector's evidence is the force over its threshold."""


class PushOutcome:
    """A push of known force, followed step by step until its outcome is known."""

    def __init__(self, force: FloatArray, begin: float, duration: float) -> None:
        """Take the force (3,) [N], base frame, when it begins [s], and how long it lasts [s]."""
        self._size, self._begin, self._end = float(np.linalg.norm(force)), begin, begin + duration
        self._before = ""
        self._detected: float | None = None
        self._moved = False
        self._nearest: ControlStep | None = None

    def take(self, step: ControlStep) -> str:
        """Take a step in; return what became of the push once that is known, '' before."""
        if step.stamp < self._begin:
            return ""
        if self._nearest is None and step.mode is Mode.REACT and step.contact is None:
            self._before = " came while the arm was yielding already"
        if self._nearest is None or step.evidence > self._nearest.evidence:
            self._nearest = step
        if self._detected is None and step.contact is not None:
            self._detected = step.stamp - self._begin
        elif self._detected is not None:
            self._moved = self._moved or answers(step)
        return self._sentence() if step.stamp >= self._end + _GRACE_S else ""

    def _sentence(self) -> str:
        push = f"The push of {self._size:.0f} N"
        if self._detected is not None:
            answer = "the arm moved with it" if self._moved else "the arm held still: it was below what moves the arm"
            return f"{push} was detected after {self._detected:.2f} s, and {answer}."
        return f"{push}{self._before}." if self._before else f"{push} was not detected: {lacked(self._nearest)}."


def lacked(step: ControlStep | None) -> str:
    """Say what a contact would have taken in the step that was nearest to one, as the end of a sentence."""
    if step is None:
        return "no control step ran meanwhile"
    if step.mode is Mode.HOLD:
        return f"the arm held ({step.reason.rstrip('.')})"
    limits, force = step.thresholds, step.filtered_force - step.thresholds.mean
    band = np.where(force > 0, limits.upper - limits.mean, limits.mean - limits.lower)
    share = np.abs(force) / band
    axis = int(np.argmax(share))
    if abs(float(share[axis]) - step.evidence) < _SAME:
        return (
            f"the filtered force came to {abs(force[axis]):.1f} N along {'xyz'[axis]}, and {band[axis]:.1f} N would"
            " have been a contact then"
        )
    return f"the evidence came to {step.evidence:.2f}, and 1 would have been a contact"
