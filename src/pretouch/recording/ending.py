"""The index at the end of an MCAP file, made from its chunks, so that it opens everywhere."""

import zlib
from collections import Counter
from dataclasses import dataclass

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


def entry(chunk: Chunk, start: int) -> Entry:
    """Make the index of a chunk that begins at an offset of the file."""
    places: dict[int, list[tuple[int, int]]] = {}
    for message in messages(chunk):
        places.setdefault(message.channel, []).append((message.log_time, message.offset))
    times = [time for rows in places.values() for time, _ in rows] or [0]
    index, offsets = bytearray(), {}
    for channel, rows in places.items():
        offsets[channel] = start + len(chunk.record) + len(index)
        index += _written(records.MessageIndex(channel, rows))
    record = records.ChunkIndex(
        len(chunk.record), start, chunk.compression, chunk.compressed_size, message_end_time=max(times),
        message_index_length=len(index), message_index_offsets=offsets, message_start_time=min(times),
        uncompressed_size=len(chunk.content),
    )  # fmt: skip
    return Entry(bytes(index), _written(record), {c: len(rows) for c, rows in places.items()}, min(times), max(times))


def in_chunk(chunk: Chunk) -> Chunk:
    """Return a chunk as it is, and a message outside one in a chunk of its own."""
    if chunk.record[0] == Opcode.CHUNK:
        return chunk
    times, content = [message.log_time for message in messages(chunk)], chunk.content
    record = _written(records.Chunk("", content, max(times), min(times), zlib.crc32(content), len(content)))
    return Chunk(chunk.start, record, "", len(content), content, chunk.end)


def header(profile: str, library: str) -> bytes:
    """Return the begin of a file."""
    return MAGIC + _written(records.Header(profile, library))


def ending(contents: Contents, entries: list[Entry], at: int) -> bytes:
    """Return all that follows the last chunk, at an offset of the file: end of the data, index, footer, magic."""
    data_end = _written(records.DataEnd(0))
    start = at + len(data_end)
    groups = {
        Opcode.SCHEMA: [record for _, record in contents.schemas.values()],
        Opcode.CHANNEL: [record for _, _, record in contents.channels.values()],
        Opcode.STATISTICS: [_statistics(contents, entries)],
        Opcode.CHUNK_INDEX: [e.record for e in entries],
    }
    summary, offsets = b"", b""
    for opcode, of_group in groups.items():
        group = b"".join(of_group)
        offsets += _written(records.SummaryOffset(opcode, start + len(summary), len(group)))
        summary += group
    without_crc = _written(records.Footer(start, start + len(summary), 0))[:-4]
    crc = zlib.crc32(without_crc, zlib.crc32(summary + offsets))
    return data_end + summary + offsets + _written(records.Footer(start, start + len(summary), crc)) + MAGIC


def _statistics(contents: Contents, entries: list[Entry]) -> bytes:
    counts: Counter[int] = Counter()
    for e in entries:
        counts.update(e.counts)
    first, last = min((e.first for e in entries), default=0), max((e.last for e in entries), default=0)
    return _written(records.Statistics(
        attachment_count=0, channel_count=len(contents.channels), channel_message_counts=counts,
        chunk_count=len(entries), message_count=counts.total(), message_end_time=last, message_start_time=first,
        metadata_count=0, schema_count=len(contents.schemas),
    ))  # fmt: skip


def _written(record: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
