"""Files that are cut off, damaged, or not ours: everything whole counts, and no file is worse than one sentence."""

import os
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from pretouch.errors import RecordingError
from pretouch.recording import disk, reader
from pretouch.recording.mcap_file import Contents, chunk_at, indexed_chunks, message_count
from pretouch.recording.reader import Recorded, open_recording
from pretouch.recording.ros import definition, packed_data, packed_message
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import Skin
from tests.following_arm import controller_of
from tests.fuzz.invariants import same
from tests.recording.runs import Run, changed, custom_arm, read_whole, recorded_run


@pytest.fixture(scope="module")
def tiny(controller, tmp_path_factory) -> tuple[Path, Run]:
    """Eight cycles in chunks of a few messages."""
    folder = tmp_path_factory.mktemp("tiny")
    run = recorded_run(folder / "whole.mcap", controller, 8)
    return changed(folder / "whole.mcap", folder / "tiny.mcap", per_chunk=7), run


def opened(place: Path) -> Recorded | None:
    """A recording with all of it read, or None of a file that is refused with a sentence."""
    try:
        return read_whole(place)
    except RecordingError as error:
        refused = str(error)
    assert "\n" not in refused
    return None


@pytest.mark.parametrize("stride", [17, pytest.param(1, marks=pytest.mark.slow)])
def test_a_file_cut_off_at_any_byte_gives_its_whole_chunks(tmp_path, stride):
    model = RobotModel(custom_arm(tmp_path))
    run = recorded_run(tmp_path / "whole.mcap", controller_of(model, Skin([], model)), 2)
    place, part = tmp_path / "tiny.mcap", tmp_path / "part.mcap"
    ours = lambda topic, number, data: data if topic.startswith("/pretouch/") else None  # noqa: E731
    whole = changed(tmp_path / "whole.mcap", place, ours, per_chunk=2).read_bytes()
    part.write_bytes(whole)
    refused, kept = 0, {}
    for size in range(len(whole) - 1, -1, -stride):
        os.truncate(part, size)
        try:
            kept[size] = open_recording(part)
        except RecordingError:
            refused = max(refused, size)
    counts = [len(kept[size]) for size in sorted(kept)]
    assert refused < min(kept)
    assert counts == sorted(counts)
    assert all("the end is missing" in recorded.sentence for recorded in kept.values())
    assert len(kept[max(kept)]) == len(run.cycles)
    assert opened(place).complete


def middle_chunk(place: Path) -> tuple[int, int]:
    """Offset and length of the chunk in the middle of a file, by its index."""
    with place.open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    return chunks[len(chunks) // 2].chunk_start_offset, chunks[len(chunks) // 2].chunk_length


@pytest.mark.parametrize("at", [4, 200], ids=["length", "content"])
def test_a_damaged_chunk_without_an_index_ends_what_is_read(tiny, tmp_path, at):
    place, run = tiny
    data, (start, _) = bytearray(place.read_bytes()), middle_chunk(place)
    data[start + at] ^= 0xFF
    (tmp_path / "a.mcap").write_bytes(data)
    recorded = opened(tmp_path / "a.mcap")
    assert "damaged; every whole part before it is read" in recorded.sentence
    assert 0 < len(recorded) < len(run.cycles)
    assert all(same(kept.step, c.step) for kept, c in zip(recorded, run.cycles, strict=False))


def test_a_damaged_chunk_that_the_index_lists_is_one_sentence_where_it_is_read(controller, tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "_CHUNK", 20_000)
    place = tmp_path / "a.mcap"
    run = recorded_run(place, controller, 40)
    data, (start, length) = bytearray(place.read_bytes()), middle_chunk(place)
    data[start + length // 2] ^= 0xFF
    place.write_bytes(data)
    recorded = open_recording(place)
    assert len(recorded) == len(run.cycles)
    assert same(recorded[0].step, run.cycles[0].step)
    assert same(recorded[39].step, run.cycles[39].step)
    with pytest.raises(RecordingError, match=rf"chunk at byte {start} of the recording is damaged"):
        recorded.stamps()


@pytest.mark.parametrize("offset", [1 << 40, (1 << 63) - 1, (1 << 64) - 1])
def test_an_index_that_points_nowhere_is_one_sentence(tiny, offset):
    with tiny[0].open("rb") as file:
        (chunk, *_) = indexed_chunks(file, Contents())
        channel = next(iter(chunk.message_index_offsets))
        with pytest.raises(RecordingError, match="is damaged"):
            chunk_at(file, offset, Contents())
        chunk.message_index_offsets[channel] = offset
        with pytest.raises(RecordingError, match="is damaged"):
            message_count(file, chunk, channel)


def test_what_is_read_first_is_the_index_and_what_describes_the_run(controller, tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "_CHUNK", 20_000)
    place = tmp_path / "a.mcap"
    run = recorded_run(place, controller, 200)
    offsets: list[int] = []
    read = reader.chunk_at
    monkeypatch.setattr(reader, "chunk_at", lambda file, at, contents: offsets.append(at) or read(file, at, contents))
    recorded = open_recording(place)
    assert len(offsets) == 1
    assert len(recorded) == len(run.cycles)
    assert all(same(kept.step, c.step) for kept, c in zip(recorded, run.cycles, strict=True))
    assert offsets[1:] == sorted(set(offsets[1:]))
    assert len(offsets) > 10


def test_a_file_with_any_byte_changed_is_no_worse_than_a_sentence(tiny, tmp_path):
    place, _ = tiny
    data, rng, part = place.read_bytes(), np.random.default_rng(0), tmp_path / "part.mcap"
    for at in rng.choice(len(data), 400, replace=False).tolist():
        part.write_bytes(data[:at] + bytes([data[at] ^ int(rng.integers(1, 256))]) + data[at + 1 :])
        opened(part)


@pytest.mark.parametrize("options", [{"compression": CompressionType.LZ4}, {"compression": CompressionType.NONE}])
def test_a_file_that_another_tool_wrote_anew_opens_too(tiny, tmp_path, options):
    place, run = tiny
    recorded = opened(changed(place, tmp_path / "a.mcap", per_chunk=5, **options))
    assert recorded.complete
    assert all(same(kept.step, c.step) for kept, c in zip(recorded, run.cycles, strict=True))
    data = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "b.mcap").write_bytes(data[: len(data) // 2])
    part = opened(tmp_path / "b.mcap")
    assert not part.complete
    assert 0 < len(part) < len(run.cycles)
    assert all(same(kept.step, c.step) for kept, c in zip(part, run.cycles, strict=False))


def foreign(place: Path, profile: str = "ros2", topic: str = "/scan", kind: str = "sensor_msgs/msg/Range") -> None:
    with place.open("wb") as file:
        writer = Writer(file)
        writer.start(profile, "other")
        schema = writer.register_schema(kind, "ros2msg", definition(kind).encode() if "/" in kind else b"")
        writer.add_message(writer.register_channel(topic, "cdr", schema), 0, b"\0\1\0\0", 0)
        writer.finish()


def test_what_is_no_recording_of_ours_is_refused_with_the_way_out(tmp_path):
    place = tmp_path / "a.mcap"
    with pytest.raises(RecordingError, match="it does not exist"):
        open_recording(place)
    with pytest.raises(RecordingError, match="Is a directory"):
        open_recording(tmp_path)
    with pytest.raises(RecordingError, match="/dev/null is no file"):
        open_recording(Path("/dev/null"))
    place.touch()
    with pytest.raises(RecordingError, match="is empty"):
        open_recording(place)
    place.write_text("time,fx\n0,1\n")
    with pytest.raises(RecordingError, match="pretouch detect"):
        open_recording(place)
    foreign(place)
    with pytest.raises(RecordingError, match=r"not a recording of pretouch.*pretouch detect"):
        open_recording(place)
    foreign(place, profile="", topic="/pretouch/step", kind="json")
    with pytest.raises(RecordingError, match="no control step"):
        open_recording(place)


def test_messages_of_another_version_are_refused(tiny, tmp_path):
    more = {"/pretouch/step": b"float64 more\n"}
    changed(tiny[0], tmp_path / "a.mcap", schema=lambda topic, text: text + more.get(topic, b""))
    with pytest.raises(RecordingError, match=r"another version.*/pretouch/step"):
        open_recording(tmp_path / "a.mcap")


def run_with(tiny, place: Path, change: Callable[[dict], None]) -> Path:
    """The same file with what describes its run changed."""

    def message(topic: str, number: int, data: bytes) -> bytes:
        if topic != "/pretouch/run":
            return data
        table = msgspec.msgpack.decode(packed_data(data))
        change(table)
        return packed_message(number, msgspec.msgpack.encode(table))

    return changed(tiny[0], place, message)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p: p.pop("react"), r"Profile differs in react: use the version of pretouch that wrote it"),
        (lambda p: p["task"].update(elbow=1), r"TaskParams differs in task\.elbow"),
        (lambda p: p["task"].update(speed_m_s=-1.0), "speed_m_s"),
    ],
)
def test_a_profile_of_another_version_or_that_cannot_be_is_refused_with_what_differs(tiny, tmp_path, change, said):
    with pytest.raises(RecordingError, match=said):
        open_recording(run_with(tiny, tmp_path / "a.mcap", lambda table: change(table["profile"])))


@pytest.mark.parametrize(
    "parts",
    [
        {"profile": 3}, {"versions": "3"}, {"about": "x"}, {"robot": "name = 3"}, {"arm": "<mujoco"},
        {"arm": "<mujoco/>"}, {"units": {}}, {"units": [{"id": "a"}]}, {"planes": bytes(24)}, {"planes": [1, "a"]},
        {"path": {"kind": "Circle", "numbers": bytes(16), "closed": True}},
        {"path": {"kind": "WayPoints", "numbers": ["<f8", [1, 3], bytes(24)], "closed": True}},
        {"path": None},
    ],
    ids=lambda parts: "-".join(parts),
)  # fmt: skip
def test_a_run_that_makes_no_sense_is_one_sentence(tiny, tmp_path, parts):
    with pytest.raises(RecordingError) as told:
        open_recording(run_with(tiny, tmp_path / "a.mcap", lambda table: table.update(parts))).runs[0].controller()
    assert "\n" not in str(told.value)
