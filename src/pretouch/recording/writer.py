"""A run, recorded as it goes on: one MCAP file that recomputes each control step and opens in the usual viewers."""

import atexit
import math
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Self

from pretouch.controller import Controller
from pretouch.loop import Cycle
from pretouch.recording.cycles import Cycles, KeptCycle, inputs_of, items
from pretouch.recording.disk import Disk, Item
from pretouch.recording.run import JSON
from pretouch.recording.simulation import Truth
from pretouch.recording.viewer_topics import ViewerTopics
from pretouch.robot.model import RobotModel
from pretouch.signals import ended_in_order

_FASTER = 1.2
"""A run whose time passes this much faster than the clock's is a simulation."""


@dataclass(frozen=True)
class Closed:
    """What a recording became."""

    place: Path
    steps: int
    duration_s: float
    """From the first step to the last [s]."""
    sentence: str
    """How it ended, for a person to read."""


class Recording:
    """One MCAP file that a run is written to while it goes on; a recorder of `loop.run`, and a context manager.

    `record` packs what others may write to again and hands over; a thread encodes, compresses and writes, about twice a
    second. A killed process loses what was not written by then. Within `with`, SIGTERM and SIGHUP raise SystemExit
    where nobody else handles them, so that the file is closed. A file that is there already is never written over:
    RecordingError.
    """

    def __init__(self, place: Path, controller: Controller, about: Mapping[str, JSON] | None = None) -> None:
        """Begin a file for what a controller does.

        Args:
            place: file to make; its folder must be there.
            controller: whose cycles will be recorded.
            about: what else is to be known of the run, as JSON has it; `scene` with `boxes` is drawn by viewers.
        """
        self.place, self._about = Path(place), about or {}
        self._cycles = Cycles(controller, self._about)
        self._model = RobotModel(controller.model.description)
        self._show(controller)
        self._disk = Disk(self.place)
        self._steps = 0
        self._first = self._last = self._begun_at = math.nan
        self._closed: Closed | None = None
        self._as_context = ExitStack()
        atexit.register(self.close)

    def change(self, controller: Controller) -> None:
        """Let the steps from the next one on be those of another controller of the same arm."""
        self._cycles.change(controller)
        self._show(controller)

    def _show(self, controller: Controller) -> None:
        """Make what tools see that do not know our types, in the thread: one model serves one thread."""
        if self._model.description is not controller.model.description:
            self._model = RobotModel(controller.model.description)
        self._topics = ViewerTopics(controller, self._about, self._model)

    def record(self, cycle: Cycle, truth: Truth | None = None) -> None:
        """Keep one turn of the loop, and what only a simulation knows. Of the disk's troubles it raises none."""
        if self._closed is None and not self.trouble:
            self.keep(cycle, truth)

    def keep(self, cycle: Cycle, truth: Truth | None = None) -> KeptCycle:
        """Record a cycle, and return what is kept of it: also where no file takes it any more."""
        packed = self._cycles.keep(cycle, truth)
        self.write(packed)
        return packed

    def write(self, packed: KeptCycle) -> None:
        """Have what is kept of a cycle written, unless nothing is written any more."""
        if self._closed is not None or self.trouble:
            return
        stamp = packed.step.stamp
        if not self._steps:
            self._first, self._begun_at = stamp, monotonic()
        # a simulation that outruns the clock can wait, a control loop cannot
        wait = stamp - self._first > _FASTER * (monotonic() - self._begun_at)
        self._disk.put(partial(_all_items, self._topics, packed), wait)
        self._steps, self._last = self._steps + 1, stamp

    @property
    def trouble(self) -> str:
        """'' or, once nothing more can be written, a sentence that says why and what the file holds."""
        return self._disk.trouble

    def close(self) -> Closed:
        """End the file; a second time says the same again."""
        if self._closed is None:
            self._disk.close()
            duration = self._last - self._first if self._steps else 0.0
            sentence = self.trouble or (
                f"{self.place} holds {self._steps} control steps, {duration:.1f} s, in"
                f" {self._disk.size() / 1e6:.1f} MB."
            )
            self._closed = Closed(self.place, self._steps, duration, sentence)
            atexit.unregister(self.close)
        return self._closed

    def __enter__(self) -> Self:
        self._as_context.enter_context(ended_in_order())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        self._as_context.close()


def _all_items(topics: ViewerTopics, packed: KeptCycle) -> Iterator[Item]:
    """Yield the messages of a cycle, and what it is to tools that do not know our types."""
    yield from items(packed)
    yield from topics.items(inputs_of(packed.inputs).inputs, packed.step, packed.number, packed.time)
