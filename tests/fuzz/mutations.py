"""Changes of files and messages, drawn by Hypothesis: it finds the fewest that do harm."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hypothesis import strategies as st

LONGEST = 1 << 17
"""Bytes of anything that is tried."""
_NUMBER = re.compile(rb"[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?")
_NUMBERS = [
    b"nan", b"-inf", b"1e400", b"-1", b"0", b"1e308", b"5e-324", b"9" * 400, b"1_0", b"0x7f", b"true", b"''",
    b"9223372036854775808", b"-9223372036854775809", b"4294967296", b"1e-9",
]  # fmt: skip
_BYTES = [b"\0" * 4, b"\xff" * 4, b"\xff" * 8, b"\0\0\0\x80", b"\xff\xff\xff\x7f", b"\n", b"\xc3", b"\xf0\x9f\xa4\x96"]


@dataclass(frozen=True)
class Change:
    """One change; where it happens is a share of the length."""

    kind: str
    begin: float
    end: float
    number: int

    def of(self, data: bytes, words: Sequence[bytes]) -> bytes:
        """Return changed bytes."""
        a, b = sorted((int(self.begin * len(data)), int(self.end * len(data))))
        match self.kind:
            case "flip" if data:
                at = min(a, len(data) - 1)
                return data[:at] + bytes([data[at] ^ 1 << self.number % 8]) + data[at + 1 :]
            case "set":
                value = _BYTES[self.number % len(_BYTES)]
                return data[:a] + value + data[a + len(value) :]
            case "cut":
                return data[:a] + data[b:]
            case "end":
                return data[:a]
            case "repeat":
                return data[:b] + data[a:b] * (1 + self.number % 40) + data[b:]
            case "word":
                return data[:a] + words[self.number % len(words)] + data[a:]
            case "number":
                return self._number(data)
            case "swap":
                middle = (a + b) // 2
                return data[:a] + data[middle:b] + data[a:middle] + data[b:]
        return data

    def _number(self, data: bytes) -> bytes:
        there = list(_NUMBER.finditer(data))
        if not there:
            return data
        found = there[int(self.begin * (len(there) - 1))]
        return data[: found.start()] + _NUMBERS[self.number % len(_NUMBERS)] + data[found.end() :]


_KINDS = ("flip", "set", "cut", "end", "repeat", "word", "number", "swap")
_share = st.floats(0.0, 1.0)
changes: st.SearchStrategy[Any] = st.lists(
    st.builds(Change, st.sampled_from(_KINDS), _share, _share, st.integers(0, 1 << 16)), min_size=1, max_size=6
)
"""Some changes, one after the other."""


def changed(data: bytes, made: list[Change], words: Sequence[bytes]) -> bytes:
    """Return bytes with changes made."""
    for change in made:
        data = change.of(data, words)[:LONGEST]
    return data
