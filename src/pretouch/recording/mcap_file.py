"""An MCAP file, whole or cut off, read chunk by chunk (https://mcap.dev/spec)."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

from mcap.exceptions import McapError
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, ChunkIndex, Header, MessageIndex, Schema
from mcap.records import Message as Record
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdError

from pretouch.errors import RecordingError

_MAGIC = b"\x89MCAP0\r\n"
_LARGEST = 1 << 26
"""A record of more bytes is damage: our chunks have 0.3 MB, those of other tools some 10 MB."""
_DAMAGE = (McapError, ZstdError, struct.error, ValueError, KeyError, OverflowError, RuntimeError, MemoryError, OSError)
"""Errors of the library and its decompressors for bytes cut off or damaged: RuntimeError is lz4's, OSError a
file shorter than its last record, or a disk that cannot read on."""
_Kind = TypeVar("_Kind")


class Message(NamedTuple):
    """One message."""

    topic: str
    kind: str
    """Its type, as sensor_msgs/msg/Imu."""
    data: bytes
    time: int = 0
    """Time of its recording [ns]."""


@dataclass(slots=True)
class Contents:
    """Contents of a file beside its messages."""

    library: str = ""
    """Library that wrote the file."""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    """Messages of each channel, by what the end of the file says."""
    complete: bool = False
    """True if the file has its end."""

    def add(self, record: object) -> None:
        """Keep a header, a schema or a channel."""
        if isinstance(record, Header):
            self.library = record.library
        elif isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            self.channels[record.id] = record

    def kind(self, channel: Channel) -> str:
        """Return the type of a channel's messages, '' if the file does not tell it."""
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def messages(self, chunk: Chunk) -> list[Message]:
        """Return the messages of a chunk in order, and keep what else is in it; a damaged one raises."""
        messages = []
        for record in breakup_chunk(chunk, validate_crc=True):
            if isinstance(record, Record):
                messages.append(self.message(record))
            else:
                self.add(record)
        return messages

    def message(self, record: Record) -> Message:
        """Return the message of a record."""
        channel = self.channels[record.channel_id]
        return Message(channel.topic, self.kind(channel), record.data, record.log_time)


def open_mcap(place: Path, remedy: str) -> BinaryIO:
    """Open an MCAP file; RecordingError, with a remedy, for one that cannot be read or is none."""
    if place.exists() and not (place.is_file() or place.is_dir()):  # as a pipe or a device, which may have no end
        raise RecordingError(f"{place} is no file: give a recording that is one.")
    try:
        file = place.open("rb")
    except OSError as error:
        reason = "it does not exist" if isinstance(error, FileNotFoundError) else error.strerror
        raise RecordingError(f"The recording {place} cannot be read: {reason}.") from error
    if file.read(len(_MAGIC)) == _MAGIC:
        file.seek(0)
        return file
    file.close()
    if place.stat().st_size == 0:
        raise RecordingError(f"{place} is empty, because the run ended before anything was written.")
    raise RecordingError(f"{place} is not an MCAP file: {remedy}.")


def chunks(file: BinaryIO, contents: Contents) -> Iterator[tuple[int, list[Message]]]:
    """Yield offset and messages of each whole chunk, or of a message in none, up to the end of the file or damage."""
    at = file.tell()
    try:
        for record in StreamReader(file, emit_chunks=True, record_size_limit=_LARGEST).records:
            if isinstance(record, Chunk):
                yield at, contents.messages(record)
            elif isinstance(record, Record):
                yield at, [contents.message(record)]
            else:
                contents.add(record)
            at = file.tell()
    except _DAMAGE:
        contents.complete = False
    else:
        contents.complete = True


def indexed_chunks(file: BinaryIO, contents: Contents) -> list[ChunkIndex]:
    """Return what the index at the end of a file says of each chunk, in order; nothing where there is none."""
    try:
        reader = SeekingReader(file, record_size_limit=_LARGEST)
        contents.add(reader.get_header())
        summary = reader.get_summary()
    except _DAMAGE:
        summary = None
    if summary is None:
        return []
    contents.schemas.update(summary.schemas)
    contents.channels.update(summary.channels)
    contents.counts.update(summary.statistics.channel_message_counts if summary.statistics else {})
    contents.complete = True
    return sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset)


def chunk_at(file: BinaryIO, offset: int, contents: Contents) -> list[Message]:
    """Return the messages of the chunk at an offset; a damaged one is a RecordingError."""
    try:
        return contents.messages(_record_at(file, offset, Chunk))
    except _DAMAGE as error:
        raise _damaged("chunk", offset, error) from error


def message_count(file: BinaryIO, chunk: ChunkIndex, channel: int) -> int:
    """Return how many messages of a channel the index of a chunk lists; damage is a RecordingError."""
    offset = chunk.message_index_offsets.get(channel)
    if offset is None:
        return 0
    try:
        return len(_record_at(file, offset, MessageIndex).records)
    except _DAMAGE as error:
        raise _damaged("index", offset, error) from error


def _record_at(file: BinaryIO, offset: int, kind: type[_Kind]) -> _Kind:
    """Return the record at an offset; a damaged one raises."""
    file.seek(offset)
    record = next(StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=_LARGEST).records)
    if not isinstance(record, kind):
        raise ValueError("it is none")
    return record


def _damaged(what: str, offset: int, error: Exception) -> RecordingError:
    return RecordingError(
        f"The {what} at byte {offset} of the recording is damaged ({error}): use a copy that is whole."
    )
