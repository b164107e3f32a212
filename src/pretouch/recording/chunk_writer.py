"""Writes an MCAP file chunk by chunk."""

import zlib
from typing import BinaryIO

import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder

from pretouch.recording.container import Chunk, Contents
from pretouch.recording.ending import Index, ending, entry_of, header, written
from pretouch.recording.messages import LIBRARY, Item, definition

PROFILE, _ENCODING, _SCHEMA_ENCODING = "ros2", "cdr", "ros2msg"


class ChunkWriter:
    """Takes messages, and writes them in chunks that ROS and its viewers read.

    The library's writer keeps some 5 kB of each chunk until the end, half a megabyte a minute; this one keeps the line
    of the index that is about it.
    """

    def __init__(self, file: BinaryIO, most: int) -> None:
        """Begin a file whose chunks have so many bytes, before they are compressed, and the message that is beyond."""
        self._file, self._most = file, most
        self._contents, self._index = Contents(), Index()
        self._channels: dict[str, int] = {}
        self._content, self._places = RecordBuilder(), dict[int, list[tuple[int, int]]]()
        file.write(header(PROFILE, LIBRARY))

    def add(self, item: Item) -> None:
        """Take a message."""
        channel = self._channels.get(item.topic) or self._channel(item)
        self._places.setdefault(channel, []).append((item.time, self._content.count))
        records.Message(
            channel_id=channel,
            data=item.data,
            log_time=item.time,
            publish_time=item.time,
            sequence=item.sequence % 2**32,
        ).write(self._content)
        if self._content.count > self._most:
            self.flush()

    def _channel(self, item: Item) -> int:
        """Define the channel of a topic, and the schema of its type where that is new."""
        kinds, channels = [name for name, _ in self._contents.schemas.values()], self._contents.channels
        if item.kind not in kinds:
            # the name by which ROS and the viewers know a type
            schema = records.Schema(
                id=len(kinds) + 1, name=item.kind, encoding=_SCHEMA_ENCODING, data=definition(item.kind).encode()
            )
            schema.write(self._content)
            self._contents.schemas[schema.id] = item.kind, written(schema)
            kinds.append(item.kind)
        number = len(channels) + 1
        channel = records.Channel(
            id=number, topic=item.topic, message_encoding=_ENCODING, metadata={}, schema_id=kinds.index(item.kind) + 1
        )
        channel.write(self._content)
        channels[number] = item.topic, channel.schema_id, written(channel)
        self._channels[item.topic] = number
        return number

    def flush(self) -> None:
        """Write what was taken, if anything."""
        if not self._places:
            return
        content, places = bytes(self._content.end()), self._places  # type: ignore[no-untyped-call]
        self._places = {}
        times = [time for rows in places.values() for time, _ in rows]
        data = zstandard.compress(content)
        record = written(
            records.Chunk(
                compression="zstd",
                data=data,
                message_start_time=min(times),
                message_end_time=max(times),
                uncompressed_crc=zlib.crc32(content),
                uncompressed_size=len(content),
            )
        )
        start = self._file.tell()
        made = entry_of(Chunk(start, record, "zstd", len(data), content, start + len(record)), start, places)
        self._file.write(record)
        self._file.write(made.index)
        self._index.add(made)

    def finish(self) -> None:
        """Write what was taken, and the end of the file."""
        self.flush()
        self._file.write(ending(self._contents, self._index, self._file.tell()))
