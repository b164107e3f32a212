"""Descriptions of arms: limits, speed envelopes, names, and files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.fuzz.invariants import same
from tests.other_arm import copied_panda

from pretouch.errors import PretouchError, RobotModelError, SkinError
from pretouch.robot.description import (
    RobotDescription,
    SpeedEnvelope,
    description_text,
    fr3,
    is_shipped,
    load_description,
    panda,
    robot_named,
)
from pretouch.robot.model import RobotModel
from pretouch.sensing.skin import OWN_SKIN, PAPER_SKIN, skin_for


@pytest.mark.parametrize(
    ("arm", "q_min", "q_max", "qd_max", "qdd_max"),
    [
        (
            panda(),
            [-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973],
            [2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973],
            [2.175] * 4 + [2.61] * 3,
            [15, 7.5, 10, 12.5, 15, 20, 20],
        ),
        (
            fr3(),
            [-2.7437, -1.7837, -2.9007, -3.0421, -2.8065, 0.5445, -3.0159],
            [2.7437, 1.7837, 2.9007, -0.1518, 2.8065, 4.5169, 3.0159],
            [2.62] * 4 + [5.26, 4.18, 5.26],
            [10] * 7,
        ),
    ],
    ids=["panda", "fr3"],
)
def test_an_arm_has_the_names_and_limits_its_vendor_publishes(arm, q_min, q_max, qd_max, qdd_max):
    model = RobotModel(arm)
    np.testing.assert_allclose([model.q_min, model.q_max], [q_min, q_max])
    np.testing.assert_allclose(model.q_mid, np.add(q_min, q_max) / 2, atol=1e-12)
    np.testing.assert_allclose([arm.qd_max, arm.qdd_max, arm.tau_max], [qd_max, qdd_max, [87] * 4 + [12] * 3])
    np.testing.assert_allclose(np.rad2deg(arm.q_ready), [0, -45, 0, -135, 0, 90, 45])
    assert np.all((model.q_min < arm.q_ready) & (arm.q_ready < model.q_max))
    assert model.joints == tuple(f"{arm.name}_joint{j}" for j in range(1, 8))


def test_the_envelope_of_the_fr3_is_the_one_its_vendor_publishes():
    envelope, arm = fr3().envelope, RobotModel(fr3())
    np.testing.assert_allclose(envelope.offset, [0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35])
    np.testing.assert_allclose(envelope.slope, [12, 5.17, 7, 8, 34, 11, 34])
    np.testing.assert_allclose(envelope.q_upper, [2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.5205, 3.0196])
    np.testing.assert_allclose(-envelope.q_lower, [2.7501, 1.7918, 2.9065, 3.0481, 2.8101, -0.54092, 3.0196])
    # it ends within 8 mrad of the stops: on both sides of joints 2, 3 and 7 beyond them, elsewhere before
    end = envelope.offset**2 / envelope.slope
    above, below = envelope.q_upper - end - arm.q_max, arm.q_min - envelope.q_lower - end
    for beyond in (above, below):
        np.testing.assert_array_equal(np.flatnonzero(beyond > 0), [1, 2, 6])
        assert np.all((beyond > -8e-3) & (beyond < 4e-4))


def test_a_mounting_stands_in_the_file_and_a_direction_that_is_none_is_refused(tmp_path):
    folder = copied_panda(tmp_path)
    assert "gravity" not in (folder / "robot.toml").read_text()
    (folder / "robot.toml").write_text(description_text(replace(panda(), gravity=np.array([0.0, -3.0, 4.0]))))
    np.testing.assert_allclose(RobotModel(load_description(folder)).gravity, [0.0, -5.886, 7.848])
    np.testing.assert_allclose(RobotModel(robot_named(str(folder), (1.0, 0.0, 0.0))).gravity, [9.81, 0.0, 0.0])
    with pytest.raises(RobotModelError, match=r"gravity is .*: give its direction in the base frame"):
        robot_named("panda", (0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", ["qd_max", "qdd_max", "tau_max"])
@pytest.mark.parametrize(
    "bad",
    [*(np.where(np.arange(7) == 3, value, 1.0) for value in (0.0, -1.0, np.nan, np.inf))]
    + [np.ones(shape) for shape in ((6,), (8,), (7, 1), ())],
)
def test_limits_that_are_not_one_positive_number_a_joint_are_refused(name, bad):
    with pytest.raises(RobotModelError, match=f"panda: {name} is [^:]*: give 7 positive, finite numbers"):
        replace(panda(), **{name: bad})


def test_a_missing_mjcf_file_is_named():
    with pytest.raises(PretouchError, match=r"panda: the MJCF file nowhere/arm\.xml does not exist"):
        replace(panda(), mjcf=Path("nowhere/arm.xml"))


# A speed envelope

GOOD = SpeedEnvelope(np.full(2, 0.3), np.full(2, 12.0), np.ones(2), -np.ones(2), "a test")


@pytest.mark.parametrize(
    ("name", "bad", "message"),
    [
        ("offset", np.array([0.3, -0.1]), r"offset is \[ 0\.3 -0\.1\]: none may be negative"),
        ("slope", np.array([12.0, 0.0]), r"slope is \[12\.  0\.\]: all must be positive"),
        ("slope", np.array([12.0, np.nan]), r"slope is .*give one finite number a joint"),
        ("q_upper", np.array([1.0, np.inf]), r"q_upper is .*give one finite number a joint"),
        ("q_lower", -np.ones(3), r"q_lower is .*give one finite number a joint"),
        ("offset", np.array(0.3), r"offset is 0\.3: give one finite number a joint"),
        ("q_upper", np.array([1.0, -0.99]), "cannot move in both directions: give each q_upper above its q_lower"),
    ],
)
def test_an_envelope_that_is_none_is_refused(name, bad, message):
    with pytest.raises(RobotModelError, match=message):
        replace(GOOD, **{name: bad})


def test_an_envelope_for_another_number_of_joints_is_refused():
    with pytest.raises(RobotModelError, match="fr3: the speed envelope is for 2 joints: give 7 of each number"):
        replace(fr3(), envelope=GOOD)


def test_an_envelope_moves_in_by_a_margin():
    closer = GOOD.moved_in(0.2)
    np.testing.assert_allclose(closer.q_upper, 0.8)
    np.testing.assert_allclose(closer.q_lower, -0.8)
    np.testing.assert_array_equal(closer.offset, GOOD.offset)
    with pytest.raises(RobotModelError, match="cannot move in both"):
        GOOD.moved_in(1.0)


# arms by their names: of the package, and of folders


def test_the_packages_arms_have_names():
    assert robot_named("panda").mjcf == panda().mjcf
    assert robot_named("fr3").ee_body == "fr3_hand_tcp"


def test_an_unknown_name_is_refused_with_those_there_are():
    with pytest.raises(RobotModelError, match=r"no arm 'pandora': take one of panda, fr3, or a folder"):
        robot_named("pandora")


def test_only_the_packages_arms_are_shipped(tmp_path: Path):
    assert is_shipped(panda())
    assert is_shipped(fr3())
    assert not is_shipped(robot_named(str(copied_panda(tmp_path))))


def test_a_folder_is_an_arm_and_the_skin_beside_it_is_its_skin(tmp_path: Path):
    model = RobotModel(robot_named(str(copied_panda(tmp_path))))
    (tmp_path / OWN_SKIN).unlink()
    assert model.description.mjcf.parent == tmp_path
    assert [len(skin_for(model, paper=paper).mounted) for paper in (True, False)] == [7, 16]  # it is called panda
    text = PAPER_SKIN.read_text()
    second = text.index("[[unit]]", text.index("[[unit]]") + 1)
    (tmp_path / OWN_SKIN).write_text(text[:second])
    assert len(skin_for(model)) == 1
    assert len(skin_for(model, PAPER_SKIN)) == 7
    with pytest.raises(SkinError, match=r"/nowhere\.toml cannot be read"):
        skin_for(model, "/nowhere.toml")


# their files


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
        (fr3, "0.3,", '"fast",', r"offset is .*: give a list of finite numbers, one a joint \[rad/s\]"),
        (fr3, "12.0,\n    5.17", "-12.0,\n    5.17", r"slope is .*must be positive\. \(in "),
        (fr3, "[envelope]", "[[envelope]]", r"envelope is .*: give a table \[envelope\]"),
        (panda, "name = ", "naem = ", "the key 'naem' is unknown: use name, mjcf"),
        (panda, '"panda"', "7", "name is 7: give printable text"),
        (panda, '"panda.xml"', '"none.xml"', r"the MJCF file .*none.xml does not exist: check its name\. \(in "),
        (panda, '"panda.xml"', '"' + "x" * 5000 + '"', "in .*robot.toml"),
        (panda, "2.175,", '"fast",', r"qd_max is .*: give a list of finite numbers, one a joint \[rad/s\]"),
        (panda, "2.175,", "", "qd_max is .*give 7 positive"),
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
