"""The index at the end of an MCAP file, made from its chunks, so that it opens everywhere."""

import struct
import zlib
from collections import Counter
from dataclasses import dataclass

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
    index, offsets, at = b"", b"", start + len(chunk.record)
    for channel, rows in places.items():
        offsets += struct.pack("<HQ", channel, at + len(index))
        packed = b"".join(struct.pack("<QQ", *row) for row in rows)
        index += _record(Opcode.MESSAGE_INDEX, struct.pack("<HI", channel, len(packed)), packed)
    record = _record(
        Opcode.CHUNK_INDEX,
        struct.pack("<QQQQI", min(times), max(times), start, len(chunk.record), len(offsets)),
        offsets,
        struct.pack("<Q", len(index)),
        _text(chunk.compression),
        struct.pack("<QQ", chunk.compressed_size, len(chunk.content)),
    )
    return Entry(index, record, {c: len(rows) for c, rows in places.items()}, min(times), max(times))


def in_chunk(chunk: Chunk) -> Chunk:
    """Return a chunk as it is, and a message outside one in a chunk of its own."""
    if chunk.record[0] == Opcode.CHUNK:
        return chunk
    times = [message.log_time for message in messages(chunk)]
    content = chunk.content
    record = _record(
        Opcode.CHUNK,
        struct.pack("<QQQI", min(times), max(times), len(content), zlib.crc32(content)),
        _text(""),
        struct.pack("<Q", len(content)),
        content,
    )
    return Chunk(chunk.start, record, "", len(content), content, chunk.end)


def header(profile: str, library: str) -> bytes:
    """Return the begin of a file."""
    return MAGIC + _record(Opcode.HEADER, _text(profile), _text(library))


def ending(contents: Contents, entries: list[Entry], at: int) -> bytes:
    """Return all that follows the last chunk, at an offset of the file: end of the data, index, footer, magic."""
    data_end = _record(Opcode.DATA_END, struct.pack("<I", 0))
    start = at + len(data_end)
    groups = {
        Opcode.SCHEMA: [record for _, record in contents.schemas.values()],
        Opcode.CHANNEL: [record for _, _, record in contents.channels.values()],
        Opcode.STATISTICS: [_statistics(contents, entries)],
        Opcode.CHUNK_INDEX: [e.record for e in entries],
    }
    summary, offsets = b"", b""
    for opcode, records in groups.items():
        group = b"".join(records)
        offsets += _record(Opcode.SUMMARY_OFFSET, struct.pack("<BQQ", opcode, start + len(summary), len(group)))
        summary += group
    footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, start + len(summary))
    crc = zlib.crc32(footer, zlib.crc32(summary + offsets))
    return data_end + summary + offsets + footer + struct.pack("<I", crc) + MAGIC


def _statistics(contents: Contents, entries: list[Entry]) -> bytes:
    counts: Counter[int] = Counter()
    for e in entries:
        counts.update(e.counts)
    return _record(
        Opcode.STATISTICS,
        struct.pack("<QHIIII", counts.total(), len(contents.schemas), len(contents.channels), 0, 0, len(entries)),
        struct.pack("<QQ", min((e.first for e in entries), default=0), max((e.last for e in entries), default=0)),
        struct.pack("<I", 10 * len(counts)),
        *(struct.pack("<HQ", *row) for row in counts.items()),
    )


def _record(opcode: Opcode, *parts: bytes) -> bytes:
    return struct.pack("<BQ", opcode, sum(map(len, parts))) + b"".join(parts)


def _text(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded
