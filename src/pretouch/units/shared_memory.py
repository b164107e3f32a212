"""The newest value, or the last values, from one process to others in shared memory, without waiting.

The writer fills one of a few slots in turn and then tells its number. A slot holds the number, the size and a checksum
over both and the value, so that a reader takes a value whole or not at all, however writer and reader are interrupted,
and whatever order a processor shows the writes in.
"""

import mmap
import os
import pickle
import struct
import weakref
from multiprocessing import reduction
from typing import Any, Generic, TypeVar
from zlib import crc32

Value = TypeVar("Value")


class SharedMemory:
    """Bytes, zero at first, that two processes share. A spawned process that receives it uses the same memory.

    It has no name, so it is gone with the last of the two, however they end.
    """

    def __init__(self, size: int) -> None:
        handle = os.memfd_create("pretouch", os.MFD_CLOEXEC)
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


class _ValueSlots:
    """Values by their numbers, in a fixed number of slots. One writer; pickled for a spawned process."""

    def __init__(self, slots: int, most: int) -> None:
        self._slots, self._most = slots, most
        self._stride = -(-(_SLOT.size + most) // 64) * 64
        self._memory = SharedMemory(_FIRST + slots * self._stride)

    @property
    def newest(self) -> int:
        """Number of the newest value, 0 before the first."""
        return self._memory.count[0]

    def write(self, value: bytes) -> int:
        """Make a value of at most that size the newest, in place of the oldest; return its number."""
        if len(value) > self._most:
            raise ValueError(f"a value of {len(value)} bytes does not fit into {self._most}")
        memory, number = self._memory.bytes, self.newest + 1
        offset = self._offset(number)
        _SLOT.pack_into(memory, offset, number, len(value), crc32(value, number & 0xFFFFFFFF))
        memory[offset + _SLOT.size : offset + _SLOT.size + len(value)] = value
        self._memory.count[0] = number
        return number

    def value(self, number: int) -> bytes | None:
        """Return the value of a number, None if its slot holds another one or is being written."""
        memory, offset = self._memory.bytes, self._offset(number)
        stored, size, checksum = _SLOT.unpack_from(memory, offset)
        if stored != number or size > self._most:
            return None
        value = bytes(memory[offset + _SLOT.size : offset + _SLOT.size + size])
        return value if crc32(value, number & 0xFFFFFFFF) == checksum else None

    def _offset(self, number: int) -> int:
        return _FIRST + number % self._slots * self._stride


class Mailbox(_ValueSlots, Generic[Value]):
    """The newest Python object, for any number of readers."""

    def __init__(self, most: int, first: Value) -> None:
        """Make one for objects of at most so many bytes when pickled; `first` is the newest until another one is."""
        super().__init__(_SLOTS, most)
        self._last = 0, first

    def put(self, value: Value) -> None:
        """Make an object the newest."""
        self.write(pickle.dumps(value))

    def read(self) -> Value:
        """Return the newest: the same object until there is another one.

        A reader that the writer overtakes again and again gets the last one it had got whole.
        """
        for _ in range(_TRIES):
            number = self.newest
            if number == self._last[0]:
                break
            data = self.value(number)
            if data is not None:
                self._last = number, pickle.loads(data)  # noqa: S301  our own process wrote it
                break
        return self._last[1]


class Ring(_ValueSlots):
    """The last values: a reader gets each value since its last look, as far as the slots hold them.

    Each reader has a `Ring` of its own.
    """

    def __init__(self, slots: int, most: int) -> None:
        """Make an empty ring for a number of values and their largest size in bytes."""
        super().__init__(slots, most)
        self._read = 0

    def take(self) -> list[bytes]:
        """Return what was written since the last call, oldest first."""
        newest = self.newest
        numbers = range(max(self._read, newest - self._slots) + 1, newest + 1)
        self._read = newest
        return [value for value in map(self.value, numbers) if value is not None]
