"""Files of bags, opened by what they are: MCAP, a database of ROS 2, and ROS 1. Messages come in a file's own order."""

import re
import sqlite3
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pretouch.errors import RecordingError
from pretouch.imported_data.log import BAGS
from pretouch.recording.mcap_file import Contents, chunk_at, chunks, indexed_chunks
from pretouch.values import value

_DATABASE, _MCAP, _ROS1 = b"SQLite format 3\0", b"\x89MCAP0\r\n", b"#ROSBAG V2.0"
_ENCODINGS = {"cdr": "deserialize_cdr", "ros1": "deserialize_ros1"}
"""Encodings of messages, and the functions of rosbags that read them."""
_TOPICS = (
    "SELECT name, type, serialization_format, count(messages.id) FROM topics"
    " LEFT JOIN messages ON topics.id = topic_id GROUP BY topics.id"
)
_MESSAGES = (
    "SELECT name, timestamp, data FROM messages JOIN topics ON topics.id = topic_id WHERE name = ? ORDER BY messages.id"
)

Raw = tuple[str, int, bytes]
"""Topic, time of recording [ns], and bytes of a message."""


@value
class BagTopic:
    """Messages on one topic, by what a file says of them."""

    name: str
    kind: str
    """Their type, as sensor_msgs/msg/JointState."""
    encoding: str
    definition: str
    """Definition of the type, '' where the file has none."""
    count: int

    def decoder(self, place: Path) -> Callable[[bytes], Any]:
        """Return what makes a message of bytes. RecordingError for what cannot be read, also from what is returned."""
        if self.encoding not in _ENCODINGS:
            encoding = {"protobuf": "Protobuf", "": "an encoding without a name"}.get(
                self.encoding, self.encoding.upper()
            )
            raise RecordingError(f"the messages on {self.name} ({self.kind}) are in {encoding}")
        missing, kind = not self.definition.strip(), self.kind
        store = get_typestore(Stores.ROS2_HUMBLE if missing else Stores.EMPTY)
        try:  # rosbags meets what is no definition, and no message, with exceptions of any kind
            if not missing:
                store.register(get_types_from_msg(self.definition, kind))
            store.get_msgdef(kind)
        except Exception as error:
            what = "" if missing else f" ({_words(error)})"
            raise RecordingError(f"it does not hold the definition of {kind}, on {self.name}{what}") from error
        read = getattr(store, _ENCODINGS[self.encoding])

        def decode(raw: bytes) -> Any:
            try:
                return read(raw, kind)
            except Exception as error:
                empty = ", whose definition in the file is empty or missing" if missing else ""
                raise RecordingError(
                    f"A message on {self.name} of {place} is no {kind}{empty} ({_words(error)}): record it with its"
                    " definition, by `ros2 bag record -s mcap`."
                ) from error

        return decode


@value
class BagFile:
    """A file that was opened."""

    topics: tuple[BagTopic, ...]
    read: Callable[[set[str]], Iterator[Raw]]
    """Yields the messages on some topics in the order of the file."""
    complete: bool = True


@contextmanager
def opened_bag(place: Path) -> Iterator[list[BagFile]]:
    """Open the files of a bag in their order. RecordingError for what cannot be read, with the way out."""
    metadata = place / "metadata.yaml"
    text = metadata.read_text(encoding="utf-8", errors="replace") if metadata.is_file() else ""
    with ExitStack() as stack:
        if re.search(r"compression_format:\s*['\"]?\w", text):
            yield [stack.enter_context(_by_rosbags(place, rosbag2.Reader))]
            return
        files = [file for file in place.iterdir() if file.suffix in BAGS] if place.is_dir() else [place]
        files = [file for file in files if file.name in text] or files
        files.sort(key=lambda file: (len(file.name), file.name))
        yield [stack.enter_context(_opened(file)) for file in files]


@contextmanager
def _opened(place: Path) -> Iterator[BagFile]:
    with place.open("rb") as file:
        head = file.read(32)
        file.seek(0)
        if head.startswith(_MCAP):
            yield _mcap(place, file)
        elif head.startswith(_DATABASE):
            with _database(place, head) as source:
                yield source
        elif head.startswith(_ROS1):
            with _by_rosbags(place, rosbag1.Reader) as source:
                yield source
        else:
            what = f"begins with {head[:12]!r}, as no such file does" if head else "is empty"
            raise RecordingError(f"{place} cannot be read as a bag or MCAP file, for it {what}: give another file.")


def _mcap(place: Path, file: BinaryIO) -> BagFile:
    contents = Contents()
    index = indexed_chunks(file, contents)
    indexed, counts = bool(index and contents.counts), dict[Any, int](contents.counts)
    if not indexed:
        file.seek(0)
        counts = Counter(m.topic for _, messages in chunks(file, contents) for m in messages)
    if not contents.channels:
        cut = "is cut short before its first message: give a complete file"
        what = "holds no messages: give another file" if contents.complete else cut
        raise RecordingError(f"{place} cannot be read as a bag or MCAP file, for it {what}.")

    def read(topics: set[str]) -> Iterator[Raw]:
        own = {number for number, channel in contents.channels.items() if channel.topic in topics}
        some = [c.chunk_start_offset for c in index if own & (c.message_index_offsets.keys() or own)]
        file.seek(0)
        parts = (chunk_at(file, at, contents) for at in some) if indexed else (m for _, m in chunks(file, contents))
        return ((m.topic, m.time, m.data) for messages in parts for m in messages if m.topic in topics)

    channels = []
    for number, channel in contents.channels.items():
        schema = contents.schemas.get(channel.schema_id)
        kind, definition = (schema.name, schema.data.decode(errors="replace")) if schema else ("", "")
        kind = kind.replace("/", "/msg/") if kind.count("/") == 1 else kind
        count = counts.get(number if indexed else channel.topic, 0)
        channels.append(BagTopic(channel.topic, kind, channel.message_encoding, definition, count))
    return BagFile(tuple(channels), read, contents.complete)


@contextmanager
def _database(place: Path, head: bytes) -> Iterator[BagFile]:
    # the file's own header says how many pages there are, and how large one is; 1 is 65536
    size, actual = (int.from_bytes(head[16:18]) % 65535 or 65536) * int.from_bytes(head[28:32]), place.stat().st_size
    try:
        with closing(sqlite3.connect(f"{place.resolve().as_uri()}?immutable=1", uri=True)) as base:
            defined = base.execute("SELECT 1 FROM sqlite_master WHERE name = 'message_definitions'").fetchone()
            query = "SELECT topic_type, encoded_message_definition FROM message_definitions"
            texts = dict(base.execute(query)) if defined else {}
            rows = base.execute(_TOPICS).fetchall()
            channels = [BagTopic(name, kind, form, texts.get(kind, ""), count) for name, kind, form, count in rows]
            read = lambda topics: (row for topic in topics for row in base.execute(_MESSAGES, (topic,)))  # noqa: E731
            yield BagFile(tuple(channels), read)
    except sqlite3.Error as error:
        what = f"it has {actual} of {size} bytes" if actual < size else str(error)
        raise RecordingError(f"{place}, a database of ROS 2, cannot be read ({what}): give a complete file.") from error


@contextmanager
def _by_rosbags(place: Path, reader_of: Callable[[Path], Any]) -> Iterator[BagFile]:
    """Open a bag of ROS 1, or a compressed one of ROS 2."""
    try:
        with reader_of(place) as reader:
            if isinstance(reader, rosbag1.Reader):
                for index in reader.indexes.values():  # by time: in the file's order it shows where that goes back
                    index.sort(key=lambda entry: (entry.chunk_pos, entry.offset))

            def read(topics: set[str]) -> Iterator[Raw]:
                own = [c for c in reader.connections if c.topic in topics and c.msgcount]
                return ((c.topic, time, raw) for c, time, raw in (reader.messages(own) if own else ()))

            rows = [(c, getattr(c.ext, "serialization_format", "ros1")) for c in reader.connections]
            yield BagFile(
                tuple(BagTopic(c.topic, c.msgtype, form, c.msgdef.data, c.msgcount) for c, form in rows), read
            )
    except RecordingError:
        raise
    except Exception as error:  # rosbags meets broken files with exceptions of any kind
        raise RecordingError(
            f"{place} cannot be read as a bag or MCAP file ({_words(error)}): `rosbag reindex` mends one of ROS 1 that"
            " was cut short, and `ros2 bag reindex` one of ROS 2."
        ) from error


def _words(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
