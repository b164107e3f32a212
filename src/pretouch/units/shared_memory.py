"""The newest value, or the last so many, from one process to others, in shared memory; nobody ever waits for anybody.

The writer fills one of a few slots in turn and then tells its number. A slot holds the number, the size and a checksum
over both and the value, so that a reader takes a value whole or not at all, however writer and reader are interrupted,
and whatever order a processor shows the writes in.
"""

import mmap
import os
import struct
import sys
import tempfile
import weakref
from multiprocessing import reduction
from typing import Any
from zlib import crc32


class SharedMemory:
    """So many bytes, zero at first, that two processes share. Passed to a spawned process, it is the same memory there.

    It has no name, so it is gone with the last of the two, however they end.
    """

    def __init__(self, size: int) -> None:
        if sys.platform == "linux":
            handle = os.memfd_create("pretouch", os.MFD_CLOEXEC)
        else:
            with tempfile.TemporaryFile() as file:
                handle = os.dup(file.fileno())
        os.ftruncate(handle, size)
        self._open(handle, size)

    def _open(self, handle: int, size: int) -> None:
        self._handle, self.size = handle, size
        self.bytes = mmap.mmap(handle, size)
        self.count = memoryview(self.bytes)[:8].cast("Q")
        """Its first 8 bytes as one number, `count[0]`; struct would write zeros first, for the other process to see."""
        weakref.finalize(self, os.close, handle)

    def __getstate__(self) -> tuple[Any, int]:
        return reduction.DupFd(self._handle), self.size

    def __setstate__(self, state: tuple[Any, int]) -> None:
        self._open(state[0].detach(), state[1])


_SLOT = struct.Struct("@QII")
"""Number of the value, from 1; its size; checksum."""
_FIRST = 64
"""Where the slots begin: after the number of the newest value."""
_SLOTS = 4
_TRIES = 16


class Mailbox:
    """One writer, any number of readers. Pickled for a process that is being spawned, it is the same mailbox there."""

    def __init__(self, most: int) -> None:
        """Make an empty one for values of at most so many bytes."""
        self._most = most
        self._stride = _aligned(_SLOT.size + most)
        self._memory = SharedMemory(_FIRST + _SLOTS * self._stride)
        self._last: tuple[int, bytes] = (0, b"")

    def write(self, value: bytes) -> int:
        """Make a value of at most that size the newest; return its number."""
        if len(value) > self._most:
            raise ValueError(f"a value of {len(value)} bytes does not fit into the {self._most} of this mailbox")
        memory = self._memory.bytes
        number = self._memory.count[0] + 1
        _fill(memory, self._offset(number), number, value)
        self._memory.count[0] = number
        return number

    def read(self) -> tuple[int, bytes]:
        """Return number and bytes of the newest value; 0 and b"" before the first.

        A reader that the writer overtakes again and again gets the last value it had got whole.
        """
        memory = self._memory.bytes
        for _ in range(_TRIES):
            number = self._memory.count[0]
            if number == self._last[0]:
                break
            value = _read(memory, self._offset(number), number, self._most)
            if value is not None:
                self._last = number, value
                break
        return self._last

    def _offset(self, number: int) -> int:
        return _FIRST + number % _SLOTS * self._stride


class Ring:
    """The last so many values: a reader gets every one that was written since it last looked, as far as there is room.

    One writer; each reader has a `Ring` of its own, pickled for the process that is being spawned.
    """

    def __init__(self, slots: int, most: int) -> None:
        """Make an empty one for so many values of at most so many bytes each."""
        self._slots, self._most = slots, most
        self._stride = -(-(_SLOT.size + most) // 8) * 8
        self._memory = SharedMemory(_FIRST + slots * self._stride)
        self._written = self._taken = 0

    def write(self, value: bytes) -> None:
        """Add a value of at most that size; the oldest makes room."""
        if len(value) > self._most:
            raise ValueError(f"a value of {len(value)} bytes does not fit into the {self._most} of this ring")
        self._written += 1
        _fill(self._memory.bytes, self._offset(self._written), self._written, value)
        self._memory.count[0] = self._written

    def take(self) -> list[bytes]:
        """Return what was written since the last call, oldest first."""
        written = self._memory.count[0]
        first = max(self._taken, written - self._slots) + 1
        found = [
            _read(self._memory.bytes, self._offset(number), number, self._most) for number in range(first, written + 1)
        ]
        self._taken = written
        return [value for value in found if value is not None]

    def _offset(self, number: int) -> int:
        return _FIRST + number % self._slots * self._stride


def _fill(memory: mmap.mmap, offset: int, number: int, value: bytes) -> None:
    """Write a value and what guards it."""
    _SLOT.pack_into(memory, offset, number, len(value), crc32(value, number & 0xFFFFFFFF))
    start = offset + _SLOT.size
    memory[start : start + len(value)] = value


def _read(memory: mmap.mmap, offset: int, number: int, most: int) -> bytes | None:
    """Return the value of this number, None if the slot holds another one or is being written."""
    found, size, checksum = _SLOT.unpack_from(memory, offset)
    if found != number or size > most:
        return None
    start = offset + _SLOT.size
    value = bytes(memory[start : start + size])
    return value if crc32(value, number & 0xFFFFFFFF) == checksum else None


def _aligned(size: int) -> int:
    return -(-size // 64) * 64
