"""The last seconds before a HOLD that lasts until a person resumes, each in a recording of its own."""

import threading
from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Self

from pretouch.controller import Controller
from pretouch.errors import RecordingError
from pretouch.loop import Cycle
from pretouch.recording.cycles import SNAPSHOT_S, Cycles, KeptCycle
from pretouch.recording.run import JSON
from pretouch.recording.simulation import Truth
from pretouch.recording.writer import Recording


class LastSeconds:
    """A recorder that writes `hold-1.mcap`, `hold-2.mcap`, ... to a folder as HOLDs latch, and raises nothing.

    Each file ends with the step that latched, and begins with a snapshot of the controller's state: up to 3 s before
    the last seconds. What is recorded goes into a recording too, if there is one.
    """

    def __init__(
        self, controller: Controller, folder: Path, recording: Recording | None = None, seconds: float = 5.0,
        most: int = 5, about: Mapping[str, JSON] | None = None,
    ) -> None:  # fmt: skip
        """Keep the cycles of a controller.

        Args:
            controller: whose cycles will be recorded.
            folder: for the files; it is made when the first is written.
            recording: where all cycles go.
            seconds: how far back each file begins at least [s].
            most: files written at most.
            about: as for `Recording`.
        """
        self.written: list[Path] = []
        """The files so far; each is finished once `close` has returned."""
        self.trouble = ""
        """Why a file could not be written, as a sentence, or ''."""
        self._controller, self._folder = controller, Path(folder)
        self._seconds, self._most, self._about = seconds, most, dict(about or {})
        self._source: Recording | Cycles | None = recording or Cycles(controller, self._about)
        """What makes bytes of a cycle; None where it cannot."""
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
        if len(self.written) + bool(self.trouble) >= self._most:
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
