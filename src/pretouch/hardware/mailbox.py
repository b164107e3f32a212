"""The newest value, from one process to any number of others, in shared memory; nobody ever waits for anybody.

The writer fills one of a few slots in turn and then tells its number. A slot holds the number, the size and a checksum
over both and the value, so that a reader takes a value whole or not at all, however writer and reader are interrupted,
and whatever order a processor shows the writes in.
"""

import mmap
import struct
from zlib import crc32

from pretouch.hardware.shared import SharedMemory

SLOT = struct.Struct("@QII")
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
        self._stride = _aligned(SLOT.size + most)
        self._memory = SharedMemory(_FIRST + _SLOTS * self._stride)
        self._last: tuple[int, bytes] = (0, b"")

    def write(self, value: bytes) -> int:
        """Make a value of at most that size the newest; return its number."""
        if len(value) > self._most:
            raise ValueError(f"a value of {len(value)} bytes does not fit into the {self._most} of this mailbox")
        memory = self._memory.bytes
        number = self._memory.count[0] + 1
        fill_slot(memory, self._place(number), number, value)
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
            value = read_slot(memory, self._place(number), number, self._most)
            if value is not None:
                self._last = number, value
                break
        return self._last

    def _place(self, number: int) -> int:
        return _FIRST + number % _SLOTS * self._stride


def fill_slot(memory: mmap.mmap, place: int, number: int, value: bytes) -> None:
    """Write a value and what guards it."""
    SLOT.pack_into(memory, place, number, len(value), crc32(value, number & 0xFFFFFFFF))
    start = place + SLOT.size
    memory[start : start + len(value)] = value


def read_slot(memory: mmap.mmap, place: int, number: int, most: int) -> bytes | None:
    """Return the value of this number, None if the slot holds another one or is being written."""
    found, size, checksum = SLOT.unpack_from(memory, place)
    if found != number or size > most:
        return None
    start = place + SLOT.size
    value = bytes(memory[start : start + size])
    return value if crc32(value, number & 0xFFFFFFFF) == checksum else None


def _aligned(size: int) -> int:
    return -(-size // 64) * 64
