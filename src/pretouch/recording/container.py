"""An MCAP file, whole or cut off: what is in its whole chunks, and how to end a file so that it opens everywhere.

The official reader needs the index at the end of a file. Here a file is read from its start, so one that was cut off,
or that is damaged in the middle, gives all the rest. The format is at https://mcap.dev/spec.
"""

import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import BinaryIO

from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")
_COMPRESSION = re.compile(rb"\x04\0\0\0zstd|\x03\0\0\0lz4", re.DOTALL)
"""What stands in the head of a chunk."""
_BLOCK, _OVERLAP = 1 << 20, 128
_LARGEST = 1 << 26
"""A chunk, message, schema or channel of more bytes is damage: ours have 0.3 MB, those of other tools some 10 MB."""
_NEEDED = {Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK}


@dataclass(frozen=True, slots=True)
class Message:
    """One message."""

    channel: int
    sequence: int
    log_time: int
    """[ns]"""
    data: bytes
    offset: int
    """Where its record begins in its chunk, uncompressed."""


@dataclass(slots=True)
class Chunk:
    """A whole chunk: its record in the file, and the records in it."""

    start: int
    """Offset of its record in the file."""
    record: bytes
    compression: str
    compressed_size: int
    content: bytes
    """Its records, uncompressed."""
    end: int
    """Offset in the file behind it and the message indexes that follow it."""


@dataclass
class Contents:
    """What was found beside chunks while a file was scanned."""

    profile: str = ""
    library: str = ""
    """What wrote it."""
    schemas: dict[int, tuple[str, bytes]] = field(default_factory=dict)
    """Name and record of each schema."""
    channels: dict[int, tuple[str, int, bytes]] = field(default_factory=dict)
    """Topic, schema and record of each channel."""
    complete: bool = False
    """Whether the file has its end: index, footer and magic."""
    damaged: int = 0
    """Records that were left out because what they hold is damaged."""

    def definitions(self) -> Iterator[bytes]:
        """Yield the record of each schema, then of each channel."""
        yield from (record for _, record in self.schemas.values())
        yield from (record for _, _, record in self.channels.values())

    def of(self, channel: int) -> tuple[str, str, bytes]:
        """Return topic, type and schema record of a channel, empty where it is not known."""
        topic, schema, _ = self.channels.get(channel, ("", -1, b""))
        return topic, *self.schemas.get(schema, ("", b""))


def begins_as_mcap(file: BinaryIO) -> bool:
    """Read the first bytes of a file and say whether they are those of an MCAP file."""
    return file.read(len(MAGIC)) == MAGIC


def scan(file: BinaryIO, contents: Contents) -> Iterator[Chunk]:
    """Go on from behind a file's first magic, and yield each whole chunk; what else is found goes into `contents`.

    A message outside a chunk comes as a chunk of its own. A chunk comes once its message indexes have been passed.
    """
    last: Chunk | None = None
    begin, size = file.tell(), file.seek(0, os.SEEK_END)
    file.seek(begin)
    while True:
        start = file.tell()
        head = file.read(_HEAD.size)
        opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, 0)
        needed = opcode in _NEEDED
        if not 0 < opcode < 0x80 or length > size - file.tell() or (needed and length > _LARGEST):
            if not _to_next_chunk(file, start + 1, size):
                break
            contents.damaged += 1
            continue
        body = file.read(length) if needed else b""
        if not needed:
            file.seek(length, os.SEEK_CUR)
        if opcode == Opcode.MESSAGE_INDEX and last is not None:
            last.end = file.tell()
            continue
        if last is not None:
            yield last
            last = None
        if opcode == Opcode.FOOTER:
            contents.complete = file.read(len(MAGIC) + 1) == MAGIC
            break
        if opcode == Opcode.CHUNK:
            last = _chunk(start, head + body, contents)
        elif opcode == Opcode.MESSAGE and length < _MESSAGE.size:
            contents.damaged += 1
        elif opcode == Opcode.MESSAGE:
            yield Chunk(start, head + body, "", length, head + body, file.tell())
        else:
            _note(opcode, head + body, contents)
    if last is not None:
        yield last


def _to_next_chunk(file: BinaryIO, start: int, end: int) -> bool:
    """Go to the next chunk from an offset on whose head makes sense, past what is no record; say if there is one.

    A chunk that does not end in the file, whose length is `end`, is none. What is read grows with the way: many short
    ways take no longer than a long one.
    """
    kept, at, size = b"", start, 32 * _OVERLAP
    file.seek(start)
    while block := file.read(size):
        size = min(2 * size, _BLOCK)
        text, at = kept + block, at - len(kept)
        for found in _COMPRESSION.finditer(text):
            begin = found.start() - _HEAD.size - _CHUNK.size
            if begin < 0 or found.end() + 8 > len(text):
                continue
            opcode, length = _HEAD.unpack_from(text, begin)
            (packed,) = struct.unpack_from("<Q", text, found.end())
            whole = length == found.end() + 8 - begin - _HEAD.size + packed and at + begin + _HEAD.size + length <= end
            if opcode == Opcode.CHUNK and whole:
                file.seek(at + begin)
                return True
        kept, at = text[-_OVERLAP:], at + len(text)
    return False


def _chunk(start: int, record: bytes, contents: Contents) -> Chunk | None:
    """Return a chunk with what is in it, or None if that is damaged."""
    try:
        _, _, size, crc = _CHUNK.unpack_from(record, _HEAD.size)
        at = _HEAD.size + _CHUNK.size
        compression, at = _text(record, at)
        (compressed_size,) = struct.unpack_from("<Q", record, at)
        packed = record[at + 8 : at + 8 + compressed_size]
        content = _unpacked(compression, packed, size)
        if len(packed) < compressed_size or len(content) != size or (crc and zlib.crc32(content) != crc):
            raise ValueError("its bytes are not those that were written")
        for opcode, _, part in _records(content):
            if opcode != Opcode.MESSAGE:
                _note(opcode, part, contents)
    except Exception:  # each decompressor has exceptions of its own
        contents.damaged += 1
        return None
    return Chunk(start, record, compression, compressed_size, content, start + len(record))


def _unpacked(compression: str, packed: bytes, size: int) -> bytes:
    if size > _LARGEST:
        raise ValueError("it is too large to be a chunk")
    if compression == "zstd":
        import zstandard

        return zstandard.ZstdDecompressor(max_window_size=_LARGEST).stream_reader(packed).read(size + 1)
    if compression == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1))
    if compression:
        raise ValueError(f"the compression {compression} is unknown")
    return packed


def _records(content: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Opcode, offset and bytes, head included, of each record in a chunk."""
    at = 0
    while at < len(content):
        opcode, length = _HEAD.unpack_from(content, at)
        end = at + _HEAD.size + length
        if end > len(content):
            raise ValueError("a record does not end in its chunk")
        yield opcode, at, content[at:end]
        at = end


def messages(chunk: Chunk) -> Iterator[Message]:
    """Yield the messages of a chunk in order."""
    for opcode, offset, record in _records(chunk.content):
        if opcode == Opcode.MESSAGE and len(record) >= _HEAD.size + _MESSAGE.size:
            channel, sequence, log_time, _ = _MESSAGE.unpack_from(record, _HEAD.size)
            yield Message(channel, sequence, log_time, record[_HEAD.size + _MESSAGE.size :], offset)


def messages_of(
    file: BinaryIO, contents: Contents, wanted: Callable[[str, str], bool]
) -> Iterator[tuple[str, str, bytes, bytes]]:
    """Go on from behind a file's first magic, and yield topic, type, schema record and CDR of the messages wanted."""
    for chunk in scan(file, contents):
        for message in messages(chunk):
            topic, kind, schema = contents.of(message.channel)
            if wanted(topic, kind):
                yield topic, kind, schema, message.data


def _note(opcode: int, record: bytes, contents: Contents) -> None:
    """Keep a header, schema or channel; of others nothing is needed."""
    at = _HEAD.size
    try:
        if opcode == Opcode.HEADER:
            contents.profile, at = _text(record, at)
            contents.library, _ = _text(record, at)
        elif opcode == Opcode.SCHEMA:
            (number,) = struct.unpack_from("<H", record, at)
            contents.schemas[number] = _text(record, at + 2)[0], record
        elif opcode == Opcode.CHANNEL:
            number, schema = struct.unpack_from("<HH", record, at)
            contents.channels[number] = _text(record, at + 4)[0], schema, record
    except (struct.error, ValueError):
        contents.damaged += 1


def _text(record: bytes, at: int) -> tuple[str, int]:
    """Return a text with its length before it, and the offset behind it."""
    (size,) = struct.unpack_from("<I", record, at)
    end = at + 4 + size
    if end > len(record):
        raise ValueError("a text does not end in its record")
    return record[at + 4 : end].decode(), end
