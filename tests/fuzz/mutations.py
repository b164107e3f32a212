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
        there = list(_NUMBER.finditer(data)) if self.kind == "number" else []
        if there:
            a, b = there[int(self.begin * (len(there) - 1))].span()
        else:
            b = {"word": a, "end": len(data), "flip": a + 1}.get(self.kind, b)
        pieces = {
            "flip": [bytes([byte ^ 1 << self.number % 8 for byte in data[a:b]])], "set": _BYTES, "word": words,
            "number": _NUMBERS, "repeat": [data[a:b] * (2 + self.number % 40)],
            "swap": [data[(a + b) // 2 : b] + data[a : (a + b) // 2]],
        }.get(self.kind, [b""])  # fmt: skip
        piece = pieces[self.number % len(pieces)]
        return data[:a] + piece + data[a + len(piece) if self.kind == "set" else b :]


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
