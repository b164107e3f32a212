"""Memory that two processes see, without a name: it is gone with the last of them, however they end."""

import mmap
import os
import sys
import tempfile
import weakref
from multiprocessing import reduction
from typing import Any


class SharedMemory:
    """So many bytes, zero at first; as an argument of a process that is being spawned it is the same memory there."""

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
