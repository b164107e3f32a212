"""The last so many values, from one process to any number of others, in shared memory; nobody ever waits for anybody.

As `mailbox`, but a reader gets every value that was written since it last looked, as far as the ring still holds them.
"""

from pretouch.hardware.mailbox import SLOT, fill_slot, read_slot
from pretouch.hardware.shared import SharedMemory

_FIRST = 64


class Ring:
    """One writer; each reader has a `Ring` of its own, pickled for the process that is being spawned."""

    def __init__(self, slots: int, most: int) -> None:
        """Make an empty one for so many values of at most so many bytes each."""
        self._slots, self._most = slots, most
        self._stride = -(-(SLOT.size + most) // 8) * 8
        self._memory = SharedMemory(_FIRST + slots * self._stride)
        self._written = self._taken = 0

    def write(self, value: bytes) -> None:
        """Add a value of at most that size; the oldest makes room."""
        if len(value) > self._most:
            raise ValueError(f"a value of {len(value)} bytes does not fit into the {self._most} of this ring")
        self._written += 1
        fill_slot(self._memory.bytes, self._place(self._written), self._written, value)
        self._memory.count[0] = self._written

    def take(self) -> list[bytes]:
        """Return what was written since the last call, oldest first."""
        written = self._memory.count[0]
        first = max(self._taken, written - self._slots) + 1
        found = [
            read_slot(self._memory.bytes, self._place(number), number, self._most)
            for number in range(first, written + 1)
        ]
        self._taken = written
        return [value for value in found if value is not None]

    def _place(self, number: int) -> int:
        return _FIRST + number % self._slots * self._stride
