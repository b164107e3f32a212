from dataclasses import replace
from pathlib import Path

import pytest
from tests.fuzz.invariants import same

from pretouch.errors import RobotModelError
from pretouch.robot.description import RobotDescription, description_text, fr3, load_description, panda


def written(folder: Path, arm: RobotDescription) -> Path:
    """A folder with an arm's files, and its description in it."""
    (folder / arm.mjcf.name).write_bytes(arm.mjcf.read_bytes())
    file = folder / "robot.toml"
    file.write_text(description_text(arm))
    return file


@pytest.mark.parametrize("arm", [panda(), fr3()], ids=lambda arm: arm.name)
def test_a_description_is_read_back_as_it_was(tmp_path, arm):
    file = written(tmp_path, arm)
    for path in (tmp_path, file, str(tmp_path)):
        found = load_description(path)
        assert found.mjcf == tmp_path / arm.mjcf.name
        assert same(replace(found, mjcf=arm.mjcf), arm)


@pytest.mark.parametrize(
    ("arm", "before", "after", "sentence"),
    [
        (fr3, "offset = ", "ofset = ", "the key 'ofset' is unknown: use source, offset, slope"),
        (fr3, "0.3,", '"fast",', r"offset is .*: give a list of 7 finite numbers, one a joint \[rad/s\]"),
        (fr3, "12.0,\n    5.17", "-12.0,\n    5.17", r"slope is .*must be positive\. \(in "),
        (fr3, "[envelope]", "[[envelope]]", r"envelope is .*: give a table \[envelope\]"),
        (panda, "name = ", "naem = ", "the key 'naem' is unknown: use name, mjcf"),
        (panda, '"panda"', "7", "name is 7: give printable text"),
        (panda, '"panda.xml"', '"none.xml"', r"the MJCF file .*none.xml does not exist: check its name\. \(in "),
        (panda, '"panda.xml"', '"' + "x" * 5000 + '"', "in .*robot.toml"),
        (panda, "2.175,", '"fast",', r"qd_max is .*: give a list of 7 finite numbers, one a joint \[rad/s\]"),
        (panda, "2.175,", "nan,", "qd_max is"),
        (panda, "2.175,", "0.0,", "qd_max is .* positive"),
        (panda, "2.175,", "", "qd_max is .*give a list of 7"),
        (panda, "qdd_max", "#", "not valid TOML"),
    ],
)
def test_what_is_wrong_is_said_with_file_key_and_value(tmp_path, arm, before, after, sentence):
    file = written(tmp_path, arm())
    assert before in file.read_text()
    file.write_text(file.read_text().replace(before, after, 1))
    with pytest.raises(RobotModelError, match=sentence) as caught:
        load_description(file)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"a = [" * 3000, b"name = 0x" + b"f" * 9000])
def test_a_file_that_is_none_is_refused(tmp_path, content):
    (tmp_path / "robot.toml").write_bytes(content)
    with pytest.raises(RobotModelError, match=r"robot.toml"):
        load_description(tmp_path)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(
        RobotModelError, match=r"robot.toml cannot be read: No such file .* give robot.toml or its folder"
    ):
        load_description(tmp_path)
