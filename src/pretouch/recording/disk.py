"""A recording's file and the thread that writes it, so that no disk makes a control loop wait."""

import errno
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import chain
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import BinaryIO

from pretouch.errors import RecordingError
from pretouch.recording.chunk_writer import ChunkWriter
from pretouch.recording.container import Contents, begins_as_mcap, scan
from pretouch.recording.ending import Entry, Index, ending, entry
from pretouch.recording.messages import Item

_FLUSH_S = 0.5
"""Time after which what was recorded is written [s]."""
_CHUNK = 1 << 18
"""Bytes of messages in a chunk at most: to index more of them at once would keep a fast loop waiting."""
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LATE_S = 0.2
"""Time for which a cycle waits to be written when a run that is faster than the clock should wait too [s]."""
_PATIENCE_S = 10.0
"""Time it then waits at most [s]."""
_MOST_WAITING = 20_000
"""Cycles that may wait to be written: a disk that is farther behind is too slow."""


More = Callable[[], Iterable[Item]]
"""Makes messages."""


class _File:
    """A file without a buffer: what is written is with the operating system, which a killed process does not undo."""

    def __init__(self, place: Path) -> None:
        self._handle = os.open(place, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666)
        self._at = 0

    def write(self, data: bytes) -> int:
        left = memoryview(data)
        while left:
            left = left[os.write(self._handle, left) :]
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        """Nothing waits."""

    def end_at(self, size: int, tail: bytes) -> None:
        """Cut the file off at a size and end it with a tail."""
        os.ftruncate(self._handle, size)
        os.lseek(self._handle, size, os.SEEK_SET)
        self._at = size
        self.write(tail)

    def close(self) -> None:
        os.close(self._handle)


class Disk:
    """Takes messages at once, and writes them in a thread of its own."""

    def __init__(self, place: Path) -> None:
        self._place = place
        self._file = _opened(place)
        self._queue: SimpleQueue[tuple[list[Item], More] | None] = SimpleQueue()
        self._since: deque[float] = deque()
        """When each cycle was put that is not written yet [s]."""
        try:
            self._writer = ChunkWriter(self._file, _CHUNK)  # type: ignore[arg-type]
        except OSError as error:
            self._file.close()
            place.unlink()
            raise _refused(place, error) from error
        self.trouble = ""
        """Why nothing more is written, as a sentence, or ''."""
        self._thread = threading.Thread(target=self._work, name=f"recording {place.name}", daemon=True)
        self._thread.start()

    def put(self, items: list[Item], more: More = tuple) -> None:
        """Hand messages over, and what makes more of them, in the thread."""
        if self._queue.qsize() > _MOST_WAITING and not self.trouble:
            self.trouble = f"The recording {self._place} ended early, because the disk is too slow: use a faster one."
        self._since.append(time.monotonic())
        self._queue.put((items, more))

    def behind(self) -> bool:
        """Whether something has waited to be written for a while."""
        try:
            return time.monotonic() - self._since[0] > _LATE_S
        except IndexError:  # the thread has just written the last
            return False

    def wait(self) -> None:
        """Let the thread catch up for a while."""
        until = time.monotonic() + _PATIENCE_S
        while self._since and self._thread.is_alive() and time.monotonic() < until:
            time.sleep(0.002)

    def close(self) -> None:
        """Write what waits, end the file, and stop."""
        self._queue.put(None)
        self._thread.join()

    def size(self) -> int:
        """Return the size of the file [B]; 0 if somebody took it away."""
        try:
            return self._place.stat().st_size
        except OSError:
            return 0

    def _work(self) -> None:
        try:
            self._write_all()
            self._writer.finish()
        except OSError as error:
            self._rescue(error)
        except Exception as error:  # the run goes on, whatever failed here
            self.trouble = f"The recording {self._place} ended early: {type(error).__name__}: {error}."
            self._rescue(None)
        with suppress(OSError):  # of what was written, the system has said by now what it has to say
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
                items, more = job
                for item in chain(items, more()):
                    self._writer.add(item)
                self._since.popleft()
                time.sleep(0)  # lets the control loop have the interpreter, if it waits for it
            if time.monotonic() >= due:
                self._writer.flush()
                due = time.monotonic() + _FLUSH_S

    def _rescue(self, error: OSError | None) -> None:
        """End the file after as many whole chunks as leave room for the index."""
        contents = Contents()
        self.trouble = self.trouble or f"The recording {self._place} ended early."  # nobody waits for what follows
        try:
            with self._place.open("rb") as file:
                begins_as_mcap(file)
                entries, ends = _indexed(file, contents)
            held = _end(self._file, contents, entries, ends)
        except (OSError, ValueError) as another:
            held, error = "it cannot be opened", another if isinstance(another, OSError) else error
        cause = os.strerror(error.errno) if error and error.errno else str(error or "")
        if error is not None:
            remedy = "free some space, then record again" if error.errno in _FULL else "check the disk"
            self.trouble = f"The recording {self._place} ended early ({cause}) and {held}: {remedy}."


def _indexed(file: BinaryIO, contents: Contents) -> tuple[list[Entry], list[int]]:
    """Index of each chunk that is followed by all of its message indexes, and where those end."""
    entries: list[Entry] = []
    ends: list[int] = []
    for chunk in scan(file, contents):
        made = entry(chunk, chunk.start)
        if chunk.end != chunk.start + len(chunk.record) + len(made.index):
            break
        entries.append(made)
        ends.append(chunk.end)
    return entries, ends


def _end(file: _File, contents: Contents, entries: list[Entry], ends: list[int]) -> str:
    """Write the index, of fewer chunks if it does not fit, and say what the file then holds."""
    for count in range(len(entries), 0, -1):
        try:
            file.end_at(ends[count - 1], ending(contents, Index.of(entries[:count]), ends[count - 1]))
        except OSError as error:
            if error.errno not in _FULL:
                raise
        else:
            return f"it holds the run up to {entries[count - 1].last / 1e9:.2f} s"
    file.end_at(0, b"")
    return "it holds nothing"


def _opened(place: Path) -> _File:
    try:
        return _File(place)
    except OSError as error:
        raise _refused(place, error) from error


def _refused(place: Path, error: OSError) -> RecordingError:
    """Say why a file cannot be made, and the way out."""
    if isinstance(error, FileExistsError):
        return RecordingError(f"{place} exists already: give another name, or move it.")
    if not place.parent.is_dir():
        return RecordingError(f"The folder {place.parent} for the recording does not exist: create it first.")
    return RecordingError(f"The recording {place} cannot be written: {error.strerror}: give another name or folder.")
