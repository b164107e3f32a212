"""The index at the end of an MCAP file, made from its chunks, so that it opens everywhere."""

import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self

from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from pretouch.recording.container import MAGIC, Chunk, Contents, messages


@dataclass(frozen=True, slots=True)
class Entry:
    """What the index says of one chunk."""

    index: bytes
    """Its message index records, as they follow it in the file."""
    record: bytes
    """Its chunk index record."""
    counts: dict[int, int]
    """Messages of each channel."""
    first: int
    """Least log time [ns]."""
    last: int
    """Greatest log time [ns]."""


@dataclass
class Index:
    """What the index says of all chunks."""

    records: bytearray = field(default_factory=bytearray)
    """Their chunk index records."""
    chunks: int = 0
    counts: Counter[int] = field(default_factory=Counter)
    """Messages of each channel."""
    first: int = 0
    """Least log time [ns]; 0 without a chunk."""
    last: int = 0
    """Greatest log time [ns]."""

    @classmethod
    def of(cls, entries: Iterable[Entry]) -> Self:
        """Return the index of these chunks."""
        index = cls()
        for each in entries:
            index.add(each)
        return index

    def add(self, entry: Entry) -> None:
        """Take in one more chunk."""
        self.first = min(self.first, entry.first) if self.chunks else entry.first
        self.last = max(self.last, entry.last)
        self.records += entry.record
        self.chunks += 1
        self.counts.update(entry.counts)


Places = dict[int, list[tuple[int, int]]]
"""Log time [ns] and offset, in its chunk, of each message of each channel."""


def entry(chunk: Chunk, start: int) -> Entry:
    """Make the index of a chunk that begins at an offset of the file."""
    places: Places = {}
    for message in messages(chunk):
        places.setdefault(message.channel, []).append((message.log_time, message.offset))
    return entry_of(chunk, start, places)


def entry_of(chunk: Chunk, start: int, places: Places) -> Entry:
    """Make the index of a chunk of which it is known where its messages are."""
    times = [time for rows in places.values() for time, _ in rows] or [0]
    index, offsets = bytearray(), {}
    for channel, rows in places.items():
        offsets[channel] = start + len(chunk.record) + len(index)
        index += written(records.MessageIndex(channel, rows))
    record = records.ChunkIndex(
        len(chunk.record), start, chunk.compression, chunk.compressed_size, message_end_time=max(times),
        message_index_length=len(index), message_index_offsets=offsets, message_start_time=min(times),
        uncompressed_size=len(chunk.content),
    )  # fmt: skip
    return Entry(bytes(index), written(record), {c: len(rows) for c, rows in places.items()}, min(times), max(times))


def header(profile: str, library: str) -> bytes:
    """Return the begin of a file."""
    return MAGIC + written(records.Header(profile, library))


def ending(contents: Contents, index: Index, at: int) -> bytes:
    """Return all that follows the last chunk, at an offset of the file: end of the data, index, footer, magic."""
    data_end = written(records.DataEnd(0))
    start = at + len(data_end)
    groups = {
        Opcode.SCHEMA: [record for _, record in contents.schemas.values()],
        Opcode.CHANNEL: [record for _, _, record in contents.channels.values()],
        Opcode.STATISTICS: [_statistics(contents, index)],
        Opcode.CHUNK_INDEX: [bytes(index.records)],
    }
    summary, offsets = b"", b""
    for opcode, of_group in groups.items():
        group = b"".join(of_group)
        offsets += written(records.SummaryOffset(opcode, start + len(summary), len(group)))
        summary += group
    without_crc = written(records.Footer(start, start + len(summary), 0))[:-4]
    crc = zlib.crc32(without_crc, zlib.crc32(summary + offsets))
    return data_end + summary + offsets + written(records.Footer(start, start + len(summary), crc)) + MAGIC


def _statistics(contents: Contents, index: Index) -> bytes:
    return written(records.Statistics(
        attachment_count=0, channel_count=len(contents.channels), channel_message_counts=index.counts,
        chunk_count=index.chunks, message_count=index.counts.total(), message_end_time=index.last,
        message_start_time=index.first,
        metadata_count=0, schema_count=len(contents.schemas),
    ))  # fmt: skip


def written(record: records.McapRecord) -> bytes:
    """Return a record as it stands in a file."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
