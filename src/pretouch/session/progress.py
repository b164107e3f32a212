"""Messages of a run: progress, summary, and the outcome of a push."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from pretouch.controller import Controller
from pretouch.explanation import Doing, answers, explain, resumable
from pretouch.loop import Cycle, Recorder
from pretouch.modes import Event
from pretouch.types import ControlStep, FloatArray, Mode

_LINE_S = 5.0
"""Time between two lines on how it goes [s]."""
_AGAIN_S = 1.0
"""Least time between two sentences on why the arm holds [s]."""
_NEAR, _GONE = 0.6, 0.3
"""Evidence from which on a force comes near a contact, and below which it is over: free motion came to 0.5."""
_BRIEF_S = 0.05
"""A HOLD shorter than this is not counted at the end [s]."""
_GRACE_S = 0.3
"""A contact this long after the end of a push is still of it [s]: the estimate lags."""
_SAME = 1e-6
"""Difference of shares below which the detector's evidence is the force over its threshold."""


@dataclass
class RunSummary:
    """Counts of a run."""

    steps: int = 0
    contacts: int = 0
    holds: dict[str, float] = field(default_factory=dict)
    """Time held [s] by the sentence with which an event first held the arm."""

    def sentences(self, period: float) -> tuple[str, ...]:
        """Return the summary in sentences."""
        sentences = [
            f"{self.steps} control steps, {self.steps * period:.1f} s; {self.contacts}"
            f" {'contact' if self.contacts == 1 else 'contacts'}."
        ]
        lasting = [(seconds, reason) for reason, seconds in self.holds.items() if seconds >= _BRIEF_S]
        sentences += [f"Held for {seconds:.1f} s: {reason}" for seconds, reason in sorted(lasting, reverse=True)]
        return tuple(sentences)


class ProgressReporter:
    """A recorder that reports each change, and passes each cycle on to another recorder."""

    def __init__(self, further: Recorder, tell: Callable[[str], None], latched: str, of: Controller) -> None:
        """Take another recorder, what tells a sentence without waiting, what to do where a HOLD latches, and whose."""
        self._further, self._tell, self._latched, self._period = further, tell, latched, of.limits.period
        self._names = of.skin.ids if of.profile.perception else (), of.model.links
        self._nearest: ControlStep | None = None
        self._kind: tuple[Mode, Event | Doing | bool, bool] | None = None
        self._line_due = self._line_time = self._near_due = -np.inf
        self._examples: dict[Event, str] = {}
        self.summary = RunSummary()

    def record(self, cycle: Cycle) -> None:
        """Keep one turn of the loop."""
        self._further.record(cycle)
        step, summary = cycle.step, self.summary
        summary.steps += 1
        summary.contacts += step.contact is not None
        self._note_near_contact(step)
        if step.mode is Mode.HOLD:
            reason = self._examples.setdefault(step.event, step.reason)
            summary.holds[reason] = summary.holds.get(reason, 0.0) + self._period
        account = explain(step, *self._names)
        waits = account.doing is Doing.WAITING
        parts: dict[Mode, Event | Doing | bool] = {Mode.HOLD: step.event, Mode.REACT: account.doing, Mode.TRACK: waits}
        kind = (step.mode, parts[step.mode], resumable(step))
        if kind == self._kind:
            if step.stamp >= self._line_due:
                self._say(step, account.sentence)
        elif self._kind is None or kind[0] is not self._kind[0] or step.stamp >= self._line_time + _AGAIN_S:
            self._kind, self._line_time = kind, step.stamp
            self._say(step, account.sentence)

    def _note_near_contact(self, step: ControlStep) -> None:
        """Report what a force near a contact lacked: somebody may have pushed."""
        nearest = self._nearest
        if step.mode is not Mode.TRACK or step.evidence < _GONE:
            self._nearest = None
            near = nearest is not None and nearest.evidence >= _NEAR
            # its end moves the filtered force the other way
            if near and step.mode is Mode.TRACK and step.stamp >= self._near_due:
                self._near_due = step.stamp + _LINE_S
                self._tell(f"{step.mode.value.upper():5} A force was not taken for a contact: {lacked(nearest)}.")
        elif nearest is None or step.evidence > nearest.evidence:
            self._nearest = step

    def _say(self, step: ControlStep, sentence: str) -> None:
        self._line_due = step.stamp + _LINE_S
        self._tell(f"{step.mode.value.upper():5} {sentence}{self._latched if resumable(step) else ''}")


def lacked(step: ControlStep | None) -> str:
    """Return what the nearest step lacked for a contact, as the end of a sentence."""
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
        """Take a step; return the outcome of the push once it is known, '' before."""
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
        if step.stamp < self._end + _GRACE_S:
            return ""
        push = f"The push of {self._size:.0f} N"
        if self._detected is not None:
            answer = "the arm moved with it" if self._moved else "the arm held still: the push was too weak to move it"
            return f"{push} was detected after {self._detected:.2f} s, and {answer}."
        return f"{push}{self._before}." if self._before else f"{push} was not detected: {lacked(self._nearest)}."
