"""A run, recorded as it goes on: one MCAP file that recomputes each control step and opens in the usual viewers.

And the last seconds before a HOLD that lasts until a person resumes, each in a file of its own.
"""

import math
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, Self

from pretouch.controller import Controller
from pretouch.errors import RecordingError
from pretouch.loop import Cycle
from pretouch.recording.cycles import SNAPSHOT_S, Cycles, KeptCycle, inputs_of, items
from pretouch.recording.disk import Disk, Item
from pretouch.recording.simulation import Truth
from pretouch.recording.viewer_topics import ViewerTopics
from pretouch.robot.model import RobotModel
from pretouch.signals import ended_in_order

_FASTER = 1.2
"""A run whose time passes this much faster than the clock's is a simulation."""
_MOST = 5
"""Files of last seconds that are written at most."""


class Recording:
    """One MCAP file that a run is written to while it goes on; a recorder of `loop.run`, and a context manager.

    `record` packs what others may write to again and hands over; a thread encodes, compresses and writes, about twice a
    second. A killed process loses what was not written by then. Within `with`, SIGTERM and SIGHUP raise SystemExit
    where nobody else handles them, so that the file is closed. A file that is there already is never written over:
    RecordingError.
    """

    def __init__(self, place: Path, controller: Controller, about: Mapping[str, Any] | None = None) -> None:
        """Begin a file, in a folder that exists, for the cycles of a controller.

        `about` has further facts on the run, as JSON; viewers draw its `scene` with `boxes`.
        """
        self.place, self._about = Path(place), about or {}
        self._cycles = Cycles(controller, self._about)
        self._model = RobotModel(controller.model.description)
        self._show(controller)
        self._disk = Disk(self.place)
        self._steps = 0
        self._first = self._last = self._begun_at = math.nan
        self._as_context = ExitStack()

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
        if not self._disk.over:
            self.keep(cycle, truth)

    def keep(self, cycle: Cycle, truth: Truth | None = None) -> KeptCycle:
        """Record a cycle, and return what is kept of it: also where no file takes it any more."""
        packed = self._cycles.keep(cycle, truth)
        self.write(packed)
        return packed

    def write(self, packed: KeptCycle) -> None:
        """Have what is kept of a cycle written, unless nothing is written any more."""
        if self._disk.over:
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

    def close(self) -> str:
        """End the file, and say what it holds; a second time says the same again."""
        duration = self._last - self._first if self._steps else 0.0
        return self._disk.close(f"{self._steps} control steps, {duration:.1f} s")

    def __enter__(self) -> Self:
        self._as_context.enter_context(ended_in_order())
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
        self._as_context.close()


class LastSeconds:
    """A recorder that writes `hold-1.mcap`, `hold-2.mcap`, ... to a folder as HOLDs latch, and raises nothing.

    Each file ends with the step that latched, and begins with a snapshot of the controller's state: up to 3 s before
    the last seconds. What is recorded goes into a recording too, if there is one.
    """

    def __init__(
        self,
        controller: Controller,
        folder: Path,
        recording: Recording | None = None,
        seconds: float = 5.0,
        about: Mapping[str, Any] | None = None,
    ) -> None:
        """Keep the cycles of a controller.

        Args:
            controller: whose cycles will be recorded.
            folder: for the files; it is made when the first is written.
            recording: where all cycles go.
            seconds: how far back each file begins at least [s].
            about: as for `Recording`.
        """
        self.written: list[Path] = []
        """The files so far; each is finished once `close` has returned."""
        self.trouble = ""
        """Reason why a file could not be written, as a sentence, or ''."""
        self._controller, self._folder = controller, Path(folder)
        self._seconds, self._about = seconds, dict(about or {})
        self._source: Recording | Cycles | None = recording or Cycles(controller, self._about)
        """Encoder of cycles; None once it has failed."""
        self._run = b""
        self._ring: deque[KeptCycle] = deque()
        self._begins: deque[KeptCycle] = deque()
        """Those in the ring that begin with a snapshot."""
        self._longest = round(2 * (seconds + SNAPSHOT_S) / controller.limits.period)
        self._writing: list[threading.Thread] = []

    def record(self, cycle: Cycle, truth: Truth | None = None) -> None:
        """Keep one turn of the loop for a while."""
        if self._source is None:
            return
        try:
            packed = self._source.keep(cycle, truth)
        except RecordingError as error:  # a part of the profile remembers what no recording can hold
            if isinstance(self._source, Recording):
                raise
            self.trouble, self._source = f"The last seconds before a HOLD are not kept: {error}", None
            return
        self._run = packed.run or self._run
        self._ring.append(packed)
        if packed.state is not None:
            self._begins.append(packed)
        self._forget(cycle.step.stamp - self._seconds)
        if cycle.after.mode.latched and not cycle.before.mode.latched:
            self._write()

    def _forget(self, begin: float) -> None:
        """Drop what lies before the last snapshot that is older than an instant [s]."""
        while len(self._begins) > 1 and (self._begins[1].step.stamp <= begin or len(self._ring) > self._longest):
            self._begins.popleft()
            while self._ring[0] is not self._begins[0]:
                self._ring.popleft()

    def change(self, controller: Controller) -> None:
        """Let the cycles from the next one on be those of another controller of the same arm."""
        if self._source is not None:
            self._source.change(controller)
        self._controller = controller
        self._ring.clear()
        self._begins.clear()

    def close(self) -> None:
        """Wait for what is being written."""
        for thread in self._writing:
            thread.join()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(self) -> None:
        """Have what is kept written, by a thread: the arm is braking, and its loop must not wait."""
        if len(self.written) + bool(self.trouble) >= _MOST:
            return
        first = self._ring[0]._replace(run=self._run)
        thread = threading.Thread(target=self._write_all, args=(self._controller, [first, *list(self._ring)[1:]]))
        self._writing.append(thread)
        thread.start()

    def _write_all(self, controller: Controller, cycles: list[KeptCycle]) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            number = 1
            while (place := self._folder / f"hold-{number}.mcap").exists():
                number += 1
            recording = Recording(place, controller, self._about)
            for packed in cycles:
                recording.write(packed)
            recording.close()
            self.written.append(place)
            self.trouble = recording.trouble or self.trouble
        except Exception as error:  # the arm is stopping, and nothing may come between
            self.trouble = f"The last seconds before a HOLD were not saved: {error}"


def _all_items(topics: ViewerTopics, packed: KeptCycle) -> Iterator[Item]:
    """Yield the messages of a cycle, and what it is to tools that do not know our types."""
    yield from items(packed)
    yield from topics.items(inputs_of(packed.inputs).inputs, packed.step, packed.number, packed.time)
