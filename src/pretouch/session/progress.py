"""Progress messages of a run, and its summary at the end."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pretouch.loop import Cycle, Recorder
from pretouch.types import ControlStep, Mode

_NUMBERS = re.compile(r"\d+(\.\d+)?")
_LINE_S = 5.0
"""Time between two lines on how it goes [s]."""
_AGAIN_S = 1.0
"""Least time between two sentences on why the arm holds [s]."""
_BRIEF_S = 0.05
"""A HOLD shorter than this is not counted at the end [s]."""


@dataclass
class RunSummary:
    """Counts of a run."""

    steps: int = 0
    contacts: int = 0
    holds: dict[str, float] = field(default_factory=dict)
    """Time held [s] by the reason, without its numbers."""

    def sentences(self, period: float) -> tuple[str, ...]:
        """Return the summary in sentences."""
        found = [
            f"{self.steps} control steps, {self.steps * period:.1f} s; {self.contacts}"
            f" {'contact' if self.contacts == 1 else 'contacts'}."
        ]
        lasting = [(seconds, reason) for reason, seconds in self.holds.items() if seconds >= _BRIEF_S]
        found += [f"Held for {seconds:.1f} s: {reason}" for seconds, reason in sorted(lasting, reverse=True)]
        return tuple(found)


class ProgressReporter:
    """A recorder that reports each change, and passes each cycle on to another recorder."""

    def __init__(self, further: Recorder, tell: Callable[[str], None], latched: str, period: float) -> None:
        """Take another recorder, what tells a sentence without waiting, and what to do where a HOLD latches."""
        self._further, self._tell, self._latched, self._period = further, tell, latched, period
        self._kind: tuple[Mode, str, bool] | None = None
        self._line_due = self._said = -np.inf
        self._examples: dict[str, str] = {}
        self.summary = RunSummary()

    def record(self, cycle: Cycle) -> None:
        """Keep one turn of the loop."""
        self._further.record(cycle)
        step, summary = cycle.step, self.summary
        summary.steps += 1
        summary.contacts += step.contact is not None
        stem = _NUMBERS.sub("#", step.reason)
        if step.mode is Mode.HOLD:
            reason = self._examples.setdefault(stem, step.reason)
            summary.holds[reason] = summary.holds.get(reason, 0.0) + self._period
        kind = (step.mode, stem if step.mode is Mode.HOLD else "", cycle.after.mode.latched)
        if kind == self._kind:
            self._line(step)
        elif self._kind is None or kind[0] is not self._kind[0] or step.stamp >= self._said + _AGAIN_S:
            self._kind, self._said = kind, step.stamp
            self._line_due = step.stamp + _LINE_S
            self._tell(f"{step.mode.value.upper():5} {step.reason}{self._latched if cycle.after.mode.latched else ''}")

    def _line(self, step: ControlStep) -> None:
        if step.stamp < self._line_due:
            return
        self._line_due = step.stamp + _LINE_S
        near = step.obstacles.body_distance
        nearest = f", nearest {near.min():.2f} m" if len(near) else ""
        self._tell(f"{step.mode.value.upper():5} {np.linalg.norm(step.ee_velocity):.2f} m/s{nearest}")
