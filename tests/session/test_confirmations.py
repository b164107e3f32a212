"""The file of robots whose force sign is confirmed."""

from dataclasses import replace
from pathlib import Path

import pytest

from pretouch.errors import RobotError
from pretouch.session.memory import ConfirmedRobots, Identity, state_folder

ROBOT = Identity("panda", "172.16.0.2", "libfranka 0.9.2, server 5")


def test_a_robot_is_known_once_it_was_kept_and_others_stay_known(tmp_path):
    other = Identity("fr3", "172.16.0.3", "libfranka 0.21.3, server 10")
    for robot in (ROBOT, other):
        assert not ConfirmedRobots(tmp_path / "new").is_confirmed(robot)
        ConfirmedRobots(tmp_path / "new").add(robot)
    assert all(ConfirmedRobots(tmp_path / "new").is_confirmed(robot) for robot in (ROBOT, other))
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["force-sign.json"]


@pytest.mark.parametrize(
    "change", [{"kind": "fr3"}, {"address": "172.16.0.3"}, {"connection": "libfranka 0.10, server 5"}]
)
def test_another_robot_address_or_library_is_not_known(tmp_path, change):
    ConfirmedRobots(tmp_path).add(ROBOT)
    assert not ConfirmedRobots(tmp_path).is_confirmed(replace(ROBOT, **change))


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b'{"a": 3}', b"[" * 100_000, b"\x00", b"\xff\xfe\x80"])
def test_a_damaged_file_is_a_sentence_with_the_way_out(tmp_path, content):
    file = tmp_path / "force-sign.json"
    file.write_bytes(content)
    for use in (ConfirmedRobots(tmp_path).is_confirmed, ConfirmedRobots(tmp_path).add):
        with pytest.raises(RobotError, match="is damaged: delete it"):
            use(ROBOT)
    assert file.read_bytes() == content


def test_a_folder_that_cannot_be_made_is_a_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RobotError, match=r"cannot be (read|noted)"):
        ConfirmedRobots(tmp_path / "file" / "folder").add(ROBOT)


@pytest.mark.parametrize(("given", "wanted"), [("/some/where", Path("/some/where/pretouch")), ("relative", None)])
def test_the_folder_is_that_of_the_xdg_specification(given, wanted):
    assert state_folder({"XDG_STATE_HOME": given}) == (wanted or Path.home() / ".local" / "state" / "pretouch")
