"""The serial line over USB."""

import select
import sys

from micropython import const

_MOST = const(64)


class Console:
    """Reads what has come, without echo; writes text."""

    def __init__(self):
        self._poll = select.poll()
        self._poll.register(sys.stdin, select.POLLIN)

    def read(self, wait_ms):
        """Return the bytes that are there, at most 64; b"" if none come for so many ms."""
        got = bytearray()
        while len(got) < _MOST and self._poll.poll(0 if got else wait_ms):
            got += sys.stdin.buffer.read(1)
        return got

    def write(self, text):
        """Write text."""
        sys.stdout.write(text)
