"""Files that claim what they do not hold: bounds before memory or time is taken."""

import struct
import tracemalloc
from io import BytesIO

import lz4.frame
import pytest
import zstandard

from pretouch.recording.container import Contents, scan
from tests.fuzz.crashers import chunk_of

LZ4, ZSTD = lz4.frame.compress(bytes(50_000_000)), zstandard.compress(bytes(50_000_000))
BEYOND = (1 << 26) + 1


@pytest.mark.parametrize(
    "chunk",
    [chunk_of(ZSTD, 100), chunk_of(LZ4, 100, b"lz4"), chunk_of(ZSTD, BEYOND), chunk_of(b"", 1 << 62)],
    ids=["zstd", "lz4", "says too much", "says far too much"],
)
def test_a_chunk_that_holds_more_than_it_says_or_may_is_left_out_before_memory_is_taken(chunk):
    contents = Contents()
    tracemalloc.start()
    assert list(scan(BytesIO(chunk), contents)) == []
    assert tracemalloc.get_traced_memory()[1] < 2_000_000
    tracemalloc.stop()
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


def test_schemas_and_channels_are_kept_up_to_a_bound(monkeypatch):
    monkeypatch.setattr("pretouch.recording.container._MOST_DEFINED", 1000)
    name = struct.pack("<I", 300) + bytes(300)
    schemas = [struct.pack("<BQH", 0x03, 2 + len(name), number) + name for number in (1, 1, 1, 1, 2, 3, 4)]
    contents = Contents()
    list(scan(BytesIO(b"".join(schemas)), contents))
    assert (list(contents.schemas), contents.damaged) == ([1, 2, 3], 1)
