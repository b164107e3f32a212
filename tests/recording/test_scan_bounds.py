"""Damaged chunks: they are left out, and reading on takes no longer than the file is long."""

import struct
from io import BytesIO

import lz4.frame
import pytest
import zstandard

from pretouch.recording.container import Contents, scan

LZ4, ZSTD = lz4.frame.compress(bytes(50_000)), zstandard.compress(bytes(50_000))


def chunk_of(packed: bytes, size: int, compression: bytes = b"zstd", more: int = 0) -> bytes:
    """A chunk's record that says it holds `size` bytes, and that it has `more` packed ones than are there."""
    text = struct.pack("<I", len(compression)) + compression + struct.pack("<Q", len(packed) + more) + packed
    body = struct.pack("<QQQI", 0, 0, size, 0) + text
    return struct.pack("<BQ", 0x06, len(body) + more) + body


@pytest.mark.parametrize(
    "chunk",
    [chunk_of(ZSTD, 100), chunk_of(LZ4, 100, b"lz4"), chunk_of(ZSTD, 60_000), chunk_of(b"", 1 << 62)],
    ids=["zstd", "lz4", "says too much", "says far too much"],
)
def test_a_chunk_of_another_size_than_it_says_is_left_out(chunk):
    contents = Contents()
    assert list(scan(BytesIO(chunk), contents)) == []
    assert contents.damaged == 1


class Counted(BytesIO):
    """A file that counts the bytes that are read."""

    count = 0

    def read(self, size=-1):
        found = super().read(size)
        self.count += len(found)
        return found


@pytest.mark.parametrize(
    "unit", [chunk_of(b"", 10, more=10_000_000), b"\0" + chunk_of(b"", 0)], ids=["heads beyond the end", "many damages"]
)
def test_what_is_read_of_a_damaged_file_grows_no_faster_than_its_size(unit):
    small, large = Counted(b"\0" + unit * 500), Counted(b"\0" + unit * 5000)
    for file in (small, large):
        list(scan(file, Contents()))
    assert large.count < 12 * small.count
