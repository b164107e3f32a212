"""Where in a recording a page is: a position in time that moves on, jumps, and stops at the ends."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pretouch.explanation import answers
from pretouch.types import ControlStep, FloatArray, Mode

_UNMOVED = ", after a contact that did not move the arm"


class Player:
    """Plays S steps by their stamps (S,) [s]; S is at least 1."""

    def __init__(self, stamps: FloatArray) -> None:
        self._stamps = stamps.tolist()
        self._start = self._stamps[0]
        self.duration = self._stamps[-1] - self._start
        """From the first step to the last [s]."""
        self.time = 0.0
        """Since the first step [s]."""
        self.playing = False
        self.speed = 1.0

    @property
    def index(self) -> int:
        """The newest step at this time."""
        return self.index_at(self.time)

    def index_at(self, time: float) -> int:
        """Return the newest step at a time since the first [s], or the first."""
        return max(0, bisect_right(self._stamps, self._start + time + 1e-9) - 1)

    @property
    def ended(self) -> bool:
        """Whether there is no more to play."""
        return self.time >= self.duration

    def advance(self, elapsed: float) -> None:
        """Let real time [s] pass."""
        if self.playing:
            self.seek(self.time + self.speed * elapsed)
            self.playing = not self.ended

    def play(self) -> None:
        """Play on, or pause; from the end, from the start."""
        self.playing = not self.playing
        if self.playing and self.ended:
            self.time = 0.0

    def seek(self, time: float) -> None:
        """Go to a time since the first step [s], or the nearest there is."""
        self.time = min(max(time, 0.0), self.duration)

    def step(self, by: int) -> None:
        """Pause, and go some steps on or back."""
        self.playing = False
        at = min(max(self.index + by, 0), len(self._stamps) - 1)
        self.seek(self._stamps[at] - self._start)

    def seek_index(self, index: int) -> None:
        """Go to a step."""
        self.seek(self._stamps[index] - self._start)


@dataclass(frozen=True)
class TimelineEvent:
    """A contact, or a change of mode, of the recording."""

    index: int
    """The step."""
    what: str


class Timeline:
    """Events of a recording, found a few steps at a time: searching a long one takes a while."""

    def __init__(self, step: Callable[[int], ControlStep], count: int) -> None:
        """Take what returns a step, and how many there are."""
        self._step, self._count = step, count
        self._looked = 0
        self._mode: Mode | None = None
        self._answered = True
        self.found: list[TimelineEvent] = []

    @property
    def done(self) -> bool:
        """Whether all steps have been searched."""
        return self._looked == self._count

    @property
    def share(self) -> float:
        """Share of the steps that have been searched."""
        return self._looked / self._count

    def search(self, steps: int) -> None:
        """Search some more steps."""
        for i in range(self._looked, min(self._looked + steps, self._count)):
            step = self._step(i)
            what = ""
            if step.contact is not None:
                what = f"Contact of {np.linalg.norm(step.contact.force):.1f} N"
                self._answered = False
            elif self._mode is not None and step.mode is not self._mode:
                held = self._mode is Mode.REACT and not self._answered
                what = f"{self._mode.name} to {step.mode.name}{_UNMOVED if held else ''}"
            self._answered = self._answered or answers(step)
            if what:
                self.found.append(TimelineEvent(i, what))
            self._mode, self._looked = step.mode, i + 1

    def after(self, index: int) -> TimelineEvent | None:
        """The next one after a step."""
        at = bisect_right([h.index for h in self.found], index)
        return self.found[at] if at < len(self.found) else None

    def before(self, index: int) -> TimelineEvent | None:
        """The last one before a step."""
        at = bisect_left([h.index for h in self.found], index)
        return self.found[at - 1] if at else None
