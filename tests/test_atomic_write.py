"""Atomic writes beside somebody who can write into the same folder."""

import os
import stat

import pytest

from pretouch.atomic_write import atomic_replacement, atomic_write


def test_a_link_in_the_place_of_the_unfinished_file_is_not_followed(tmp_path, monkeypatch):
    monkeypatch.setattr("os.urandom", bytes)
    (tmp_path / "dear").write_text("dear")
    (tmp_path / f".{16 * '0'}.tmp").symlink_to(tmp_path / "dear")
    with pytest.raises(FileExistsError):
        atomic_write(tmp_path / "a", "new")
    assert (tmp_path / "dear").read_text() == "dear"
    assert not (tmp_path / "a").exists()


def test_two_unfinished_files_never_have_one_name_and_none_is_left(tmp_path):
    with atomic_replacement(tmp_path / "a") as one, atomic_replacement(tmp_path / "a") as other:
        assert one != other
        assert one.parent == tmp_path
    assert [file.name for file in tmp_path.iterdir()] == ["a"]


def test_a_new_file_has_the_usual_mode_and_an_old_one_keeps_its_own(tmp_path):
    before = os.umask(0o027)
    try:
        atomic_write(tmp_path / "a", "x")
        assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o640
        (tmp_path / "a").chmod(0o600)
        atomic_write(tmp_path / "a", "y")
        assert stat.S_IMODE((tmp_path / "a").stat().st_mode) == 0o600
    finally:
        os.umask(before)


def test_a_file_is_written_whole_or_not_at_all_however_long_its_name(tmp_path):
    path = tmp_path / ("x" * 255)
    atomic_write(path, "new")
    assert path.read_text() == "new"
    (tmp_path / "below").mkdir()
    with pytest.raises(IsADirectoryError):
        atomic_write(tmp_path / "below", "new")
    assert {p.name for p in tmp_path.iterdir()} == {path.name, "below"}
