"""A recording's file and the thread that writes it, so that no disk makes a control loop wait."""

import atexit
import errno
import os
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import NamedTuple

from mcap.writer import Writer

from pretouch.errors import RecordingError
from pretouch.recording.ros import LIBRARY, definition

_FLUSH_S = 0.5
"""Time after which what was recorded is written [s]."""
_CHUNK = 1 << 18
"""Bytes of messages from which on a chunk is written: to index more at once would keep a fast loop waiting."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_BEHIND = 100
"""Cycles that wait to be written when a simulation should wait too."""
_PATIENCE_S = 10.0
"""Time it then waits at most [s]."""
_MOST_WAITING = 20_000
"""Cycles that may wait to be written: a disk that is farther behind is too slow."""


class Item(NamedTuple):
    """One message to write."""

    topic: str
    kind: str
    sequence: int
    time: int
    """[ns]"""
    data: bytes


Job = Callable[[], Iterable[Item]]
"""Makes the messages of a cycle."""


class Disk:
    """Takes what makes messages at once, and writes these in a thread of its own.

    A chunk holds whole cycles: the reader counts on it. The file is ended by `close`, or with the program.
    """

    def __init__(self, place: Path) -> None:
        self._place = place
        try:
            self._file = place.open("xb")
        except OSError as error:
            raise _refused(place, error) from error
        self._queue: SimpleQueue[Job | None] = SimpleQueue()
        self._writer = Writer(self._file, chunk_size=1 << 62)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._waiting = self._newest = 0
        """Bytes of messages in the chunk that is being filled, and the latest time in it [ns]."""
        self._written: int | None = None
        """Latest time in the file [ns]."""
        try:  # a disk that is full already is no trouble of later, when the arm moves
            self._writer.start("ros2", LIBRARY)
            self._file.flush()
        except OSError as error:
            with suppress(OSError):  # what failed to be written fails again
                self._file.close()
            place.unlink()
            raise _refused(place, error) from error
        self.trouble = ""
        """Reason why nothing more is written, as a sentence, or ''."""
        self._closed = False
        self._thread = threading.Thread(target=self._work, name=f"recording {place.name}", daemon=True)
        self._thread.start()
        atexit.register(self.close)

    @property
    def over(self) -> bool:
        """True once nothing more is written."""
        return self._closed or bool(self.trouble)

    def put(self, job: Job, wait: bool = False) -> None:
        """Hand over what makes the messages of a cycle, in the thread; with `wait`, let that catch up first."""
        until = time.monotonic() + _PATIENCE_S
        while wait and self._queue.qsize() > _BEHIND and self._thread.is_alive() and time.monotonic() < until:
            time.sleep(0.002)
        if self._queue.qsize() > _MOST_WAITING and not self.trouble:
            self.trouble = f"The recording {self._place} ended early, because the disk is too slow: use a faster one."
        self._queue.put(job)

    def close(self, content: str = "") -> str:
        """Write what waits, end the file, and say that it holds the content, or what went wrong."""
        self._closed = True
        self._queue.put(None)
        self._thread.join()
        atexit.unregister(self.close)
        size = 0
        with suppress(OSError):  # somebody may have taken it away
            size = self._place.stat().st_size
        return self.trouble or f"{self._place} holds {content}, in {size / 1e6:.1f} MB."

    def _work(self) -> None:
        try:
            self._write_all()
            self._flush()
            self._writer.finish()
            self._file.flush()
        except Exception as error:  # the run goes on, whatever failed here
            self.trouble = self._sentence(error)
        with suppress(OSError):  # what failed to be written fails again
            self._file.close()

    def _write_all(self) -> None:
        due = time.monotonic() + _FLUSH_S
        while True:
            try:
                job = self._queue.get(timeout=max(0.0, due - time.monotonic()))
            except Empty:
                pass
            else:
                if job is None:
                    return
                for item in job():
                    self._add(item)
                time.sleep(0)  # lets the control loop have the interpreter, if it waits for it
            if self._waiting > _CHUNK or time.monotonic() >= due:
                self._flush()
                due = time.monotonic() + _FLUSH_S

    def _add(self, item: Item) -> None:
        channel = self._channels.get(item.topic) or self._channel(item)
        self._writer.add_message(channel, item.time, item.data, item.time, item.sequence % 2**32)
        self._waiting += len(item.data)
        self._newest = max(self._newest, item.time)

    def _channel(self, item: Item) -> int:
        """Define the channel of a topic, and the schema of its type where that is new."""
        if item.kind not in self._schemas:
            schema = self._writer.register_schema(item.kind, "ros2msg", definition(item.kind).encode())
            self._schemas[item.kind] = schema
        self._channels[item.topic] = self._writer.register_channel(item.topic, "cdr", self._schemas[item.kind])
        return self._channels[item.topic]

    def _flush(self) -> None:
        self._writer.flush()
        self._file.flush()  # to the operating system: what it has, a killed process does not undo
        if self._waiting:
            self._waiting, self._written = 0, self._newest

    def _sentence(self, error: Exception) -> str:
        """Say why nothing more is written, and what the file holds."""
        content = "nothing" if self._written is None else f"the run up to {self._written / 1e9:.2f} s"
        if not isinstance(error, OSError):
            cause, remedy = f"{type(error).__name__}: {error}", "report this"
        else:
            cause = os.strerror(error.errno) if error.errno else str(error)
            remedy = "free some space, then record again" if error.errno in _FULL else "check the disk"
        return f"The recording {self._place} ended early ({cause}) and it holds {content}: {remedy}."


def _refused(place: Path, error: OSError) -> RecordingError:
    """Say why a file cannot be made, and the way out."""
    if isinstance(error, FileExistsError):
        return RecordingError(f"{place} exists already: give another name, or move it.")
    if not place.parent.is_dir():
        return RecordingError(f"The folder {place.parent} for the recording does not exist: create it first.")
    return RecordingError(f"The recording {place} cannot be written: {error.strerror}: give another name or folder.")
