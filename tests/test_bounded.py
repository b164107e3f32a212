"""Files from elsewhere that would take all memory, wait for ever, or command a terminal."""

import os
import resource
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from pretouch import cli
from pretouch.cli import reading_bounds
from pretouch.errors import PretouchError, RecordingError
from pretouch.imported_data.parquet import read_parquet
from pretouch.importing.meshes import read_mesh
from pretouch.plain_text import plain_text
from pretouch.recording.reader import open_recording
from pretouch.recording.state_codec import _give, _Reading
from tests.importing.made import six_axis


def test_a_command_that_reads_takes_no_more_than_its_share_and_the_bounds_go_with_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(reading_bounds, "_free", lambda: 1 << 29)
    before = resource.getrlimit(resource.RLIMIT_AS), resource.getrlimit(resource.RLIMIT_FSIZE)
    said = r"^Reading takes more than 0\.2 GiB, half of what is free here"
    with pytest.raises(PretouchError, match=said), reading_bounds.bounded("detect"):
        np.ones(1 << 28)
    assert (resource.getrlimit(resource.RLIMIT_AS), resource.getrlimit(resource.RLIMIT_FSIZE)) == before


def test_other_commands_are_not_bounded() -> None:
    before = resource.getrlimit(resource.RLIMIT_AS)
    with reading_bounds.bounded("live"):
        assert resource.getrlimit(resource.RLIMIT_AS) == before
    with reading_bounds.bounded("detect"):
        assert resource.getrlimit(resource.RLIMIT_AS) != before
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.parametrize(
    "words", [("detect", "x.csv"), ("detect", "x.mcap"), ("report", "x.mcap"), ("robot", "import", "x.urdf")]
)
def test_a_pipe_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo(words[-1])
    assert cli.main([*words, *(("--out", "arm") if words[0] == "robot" else ())]) == 2
    assert f"{words[-1]} is no file: give" in capsys.readouterr().err


def test_a_device_is_no_recording() -> None:
    with pytest.raises(RecordingError, match="/dev/zero is no file"):
        open_recording(Path("/dev/zero"))


def test_a_list_of_millions_is_no_millions_of_columns_and_a_table_without_end_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "a.parquet"
    parquet.write_table(pa.table({"q": pa.array([np.zeros(100_000)])}), place)
    assert len(read_parquet(place)[0]) == 64
    monkeypatch.setattr("pretouch.imported_data.parquet._MOST_CELLS", 10)
    parquet.write_table(pa.table({"q": np.zeros(11)}), place)
    with pytest.raises(RecordingError, match="11 rows of 1 columns: cut it into parts"):
        read_parquet(place)


def test_nanoseconds_since_1970_are_numbers(tmp_path: Path) -> None:
    place, now = tmp_path / "a.parquet", 1_700_000_000_123_456_789
    parquet.write_table(pa.table({"time_ns": np.array([now, now + 10**7])}), place)
    _, numbers = read_parquet(place)
    assert np.diff(numbers([0])[:, 0])[0] == pytest.approx(1e7, abs=512)


def test_a_recorded_state_with_more_parts_than_follow_is_refused_before_they_are_made() -> None:
    class Message:
        name, kind, shape, numbers = ["sent"], ["tuple"], ["3000000000"], np.zeros(0)
        wholes, texts = np.zeros(0, np.int64), list[str]()

    with pytest.raises(ValueError, match="sent has 3000000000 parts, more than follow"):
        _give(_Reading(Message()), "sent", tuple[float, ...])


def test_a_mesh_in_an_archive_is_not_unpacked(tmp_path: Path) -> None:
    (tmp_path / "a.stl").write_bytes(b"PK\3\4" + bytes(100))
    with pytest.raises(PretouchError, match=r"a\.stl is a ZIP archive: unpack it first"):
        read_mesh(tmp_path / "a.stl")


def test_a_link_of_hundreds_of_shapes_is_refused(tmp_path: Path) -> None:
    shape = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
    (tmp_path / "arm.urdf").write_text(six_axis().replace('<link name="link3">', '<link name="link3">' + 101 * shape))
    assert cli.main(["robot", "import", str(tmp_path / "arm.urdf"), "--out", str(tmp_path / "arm")]) == 2


def test_a_terminal_is_commanded_by_nobody_elses_text(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert plain_text("a\x1b]52;c;x\x07\tb\nc") == "a?]52;c;x?\tb\nc"
    assert cli.main(["report", str(tmp_path / "a\x1b[2J.mcap")]) == 2
    assert "\x1b[2J" not in capsys.readouterr().err
