"""Files written chunk by chunk: the bytes of the library's writer, without what it keeps."""

import tracemalloc
from io import BytesIO

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from pretouch.recording.chunk_writer import ChunkWriter
from pretouch.recording.messages import LIBRARY, Item, definition

KINDS = ["sensor_msgs/msg/Range", "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/Range"]


def items(count: int) -> list[Item]:
    rng = np.random.default_rng(4)
    return [
        Item(f"/t{k}", KINDS[k], i, 10_000 - i if i < 50 else 10_000 + i, rng.bytes(int(rng.integers(1, 200))))
        for i, k in enumerate(rng.integers(0, 3, count).tolist())
    ]


def by_the_library(given: list[Item], most: int, flushed: int) -> bytes:
    file, channels, schemas = BytesIO(), {}, {}
    writer = Writer(file, most, CompressionType.ZSTD)
    writer.start("ros2", LIBRARY)
    for i, item in enumerate(given):
        if item.topic not in channels:
            if item.kind not in schemas:
                schemas[item.kind] = writer.register_schema(item.kind, "ros2msg", definition(item.kind).encode())
            channels[item.topic] = writer.register_channel(item.topic, "cdr", schemas[item.kind])
        writer.add_message(channels[item.topic], item.time, item.data, item.time, item.sequence)
        if i % flushed == 0:
            writer.flush()
    writer.finish()
    return file.getvalue()


END_OF_DATA = b"\x0f" + (4).to_bytes(8, "little") + bytes(4)


@pytest.mark.parametrize(
    ("count", "most", "flushed"), [(0, 1000, 7), (1, 1000, 7), (400, 3000, 1000), (400, 10**6, 30)]
)
def test_the_bytes_are_those_of_the_librarys_writer_and_the_index_says_the_same(count, most, flushed):
    file = BytesIO()
    writer = ChunkWriter(file, most)
    for i, item in enumerate(items(count)):
        writer.add(item)
        if i % flushed == 0:
            writer.flush()
    writer.finish()
    ours, theirs = file.getvalue(), by_the_library(items(count), most, flushed)
    assert ours.partition(END_OF_DATA)[:2] == theirs.partition(END_OF_DATA)[:2]
    assert vars(make_reader(BytesIO(ours)).get_summary()) == vars(make_reader(BytesIO(theirs)).get_summary())
    read = list(make_reader(BytesIO(ours)).iter_messages(topics=["/t1"]))
    assert len(read) == sum(item.topic == "/t1" for item in items(count))


class Nowhere(BytesIO):
    """A file of which nothing is kept."""

    at = 0

    def write(self, data) -> int:
        self.at += len(data)
        return len(data)

    def tell(self) -> int:
        return self.at


@pytest.mark.slow
def test_an_hour_of_chunks_leaves_little_in_memory():
    """Two chunks a second: the library's writer kept 33 MB of an hour of a run, and some 10 MB of these."""
    given = items(30)
    writer = ChunkWriter(Nowhere(), 10**6)
    tracemalloc.start()
    try:
        for _ in range(7200):
            for item in given:
                writer.add(item)
            writer.flush()
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert kept < 1.5e6
