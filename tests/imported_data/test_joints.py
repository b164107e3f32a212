"""Joint positions of other programs, in the order of our joints, or a sentence that says why not."""

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyarrow import parquet

from pretouch.errors import RecordingError
from pretouch.imported_data.joints import read_joints
from pretouch.recording.skin_recording import SkinRecording
from tests.imported_data.files import JOINTS, PANDA, START, joints, made, stamps, wrenches, write_bag, write_csv

Q = np.array([0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.7])
MOVING = Q + 0.01 * np.arange(50)[:, None] * np.array([1, 2, -1, 3, 1, -2, 1])
NAMED = tuple(f"q{i}_rad" for i in range(1, 8))


def table(names=NAMED, q=MOVING, begin=5.0):
    return {"time_s": begin + np.arange(len(q)) / 100} | {name: q[:, i] for i, name in enumerate(names)}


def states(q=MOVING, names=PANDA, topic="/joint_states"):
    return [(topic, t + 300_000, joints(t, row, names)) for t, row in zip(stamps(len(q)), q, strict=True)]


@pytest.mark.parametrize(
    "names",
    [
        NAMED,
        tuple(f"Q{i}_RAD" for i in range(1, 8)),
        tuple(f"{name}_rad" for name in PANDA),
        tuple(f"fr3_joint{i}_rad" for i in range(1, 8)),
        tuple(f"joint_{i}_rad" for i in range(1, 8)),
    ],
)
def test_a_csv_file_names_joints_by_number_or_by_name(tmp_path, panda_model, names):
    found = read_joints(write_csv(tmp_path / "a.csv", table(names)), panda_model)
    np.testing.assert_array_equal(found.trace.q, MOVING)
    np.testing.assert_allclose(found.trace.stamp, 5.0 + np.arange(50) / 100, atol=1e-9)
    assert found.notes == ()
    assert found.said == f"the columns {names[0]} to {names[-1]}"


def test_columns_may_stand_in_any_order_among_others_and_in_degrees(tmp_path, panda_model):
    columns = table()
    shuffled = {name.replace("rad", "deg"): np.degrees(columns[name]) for name in reversed(NAMED)}
    columns = {"dq1_rad": np.zeros(50), "torso": np.zeros(50)} | shuffled | {"time_ms": 1e3 * columns["time_s"]}
    found = read_joints(write_csv(tmp_path / "a.csv", columns, separator=";"), panda_model)
    np.testing.assert_allclose(found.trace.q, MOVING, atol=1e-12)
    assert found.notes == ("Columns that are not used: 'dq1_rad', 'torso'.",)


def test_what_is_no_number_or_comes_twice_is_left_out_and_said(tmp_path, panda_model):
    columns = table()
    columns["q3_rad"] = np.where(np.arange(50) == 7, np.nan, columns["q3_rad"])
    columns["time_s"][[20, 21]] = columns["time_s"][[21, 20]]
    columns["time_s"][31] = columns["time_s"][30]
    columns["time_s"][40] = np.nan
    found = read_joints(write_csv(tmp_path / "a.csv", columns), panda_model)
    expected = np.delete(MOVING[[*range(20), 21, 20, *range(22, 50)]], [7, 30, 40], axis=0)
    np.testing.assert_array_equal(found.trace.q, expected)
    assert np.all(np.diff(found.trace.stamp) > 0)
    assert [note[:28] for note in found.notes] == [
        "1 row has no time and was le", "Joints: 1 sample is not fini", "Joints: the time went backwa",
        "Joints: a stamp was repeated",
    ]  # fmt: skip


def test_a_bag_gives_the_joints_of_the_arm_in_its_order_and_skips_a_gripper(tmp_path, panda_model):
    gripper = states(np.zeros((50, 2)), ("panda_finger_joint1", "panda_finger_joint2"))
    messages = [m for pair in zip(states(MOVING[:, ::-1], PANDA[::-1]), gripper, strict=True) for m in pair]
    found = read_joints(write_bag(tmp_path / "bag", messages), panda_model)
    np.testing.assert_array_equal(found.trace.q, MOVING)
    np.testing.assert_allclose(found.trace.stamp, START / 1e9 + np.arange(50) / 100, atol=1e-6)
    assert found.said == "the topic /joint_states"


def test_states_without_names_are_those_of_the_arm_if_there_are_as_many(tmp_path, panda_model):
    found = read_joints(write_bag(tmp_path / "bag", states(names=())), panda_model)
    np.testing.assert_array_equal(found.trace.q, MOVING)


def test_one_of_two_arms_is_taken_by_its_full_names(tmp_path, panda_model):
    names = tuple(f"left_joint{i}" for i in range(1, 8)) + PANDA
    found = read_joints(write_bag(tmp_path / "bag", states(np.hstack([0 * MOVING, MOVING]), names)), panda_model)
    np.testing.assert_array_equal(found.trace.q, MOVING)


def test_the_arm_that_moved_is_chosen_by_its_topic(tmp_path, panda_model):
    bag = write_bag(tmp_path / "bag", states(topic="/a") + states(MOVING + 0.1, topic="/b"))
    np.testing.assert_array_equal(read_joints(bag, panda_model, "/b").trace.q, MOVING + 0.1)
    with pytest.raises(RecordingError, match="several topics of sensor_msgs/JointState: choose one by --topic, /a, /b"):
        read_joints(bag, panda_model)
    with pytest.raises(RecordingError, match="has no topic '/c'"):
        read_joints(bag, panda_model, "/c")


def test_a_recording_of_our_own_is_a_bag_too(tmp_path, panda_model):
    with SkinRecording(tmp_path / "own.mcap") as recording:
        recording.joints(np.arange(50) / 100 + 7.0, MOVING, None, PANDA)
    found = read_joints(tmp_path / "own.mcap", panda_model)
    np.testing.assert_array_equal(found.trace.q, MOVING)
    np.testing.assert_allclose(found.trace.stamp, np.arange(50) / 100 + 7.0, atol=1e-9)


def short(**changed):
    """The columns of a table with some of them changed, renamed or (None) left out."""
    columns = table()
    for name, given_as in changed.items():
        column = columns.pop(name)
        if given_as is not None:
            columns |= {given_as: column} if isinstance(given_as, str) else {name: given_as}
    return columns


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (short(time_s=None), "has 0 columns of time"),
        (short(time_s="time_min"), "has 0 columns of time"),
        (short(time_s="time"), "'time' of .* has no unit: write time_s or time_ms"),
        (short() | {"time_ms": np.zeros(50)}, "has 2 columns of time"),
        (short(q4_rad=None), "has no column for 'panda_joint4' .*add q1_rad to q7_rad, or panda_joint1_rad"),
        (short(q4_rad="q4"), "'q4' of .* has no unit: write q4_rad or q4_deg"),
        (short(q4_rad="q4_ms"), "'q4_ms' of .* has the unit 'ms': write q4_rad or q4_deg"),
        (short() | {"q4_deg": np.zeros(50)}, "names joint 4 twice, 'q4' and 'q4'"),
        (short() | {"panda_joint4_rad": np.zeros(50)}, "names joint 4 twice, 'q4' and 'panda_joint4'"),
        (short(q4_rad=np.degrees(MOVING[:, 3])), r"panda_joint4 in .* is at -131.8 rad, out of its range"),
        (short(q4_rad=np.full(50, np.nan)), "has 0 samples of all joints.* 50 samples are not finite"),
        (short(time_s=np.full(50, 3.0)), "has 1 sample of all joints.* a stamp was repeated 49 times"),
        (short(time_s=np.linspace(0, 1e9, 50)), "span 1e[+]09 s: check their unit"),
        (short(time_s=np.tile(np.arange(25) / 10, 2)), "goes back by 2.4 s at sample 26 of 50: give one recording"),
    ],
)
def test_what_is_wrong_with_a_csv_file_is_said_in_one_line(tmp_path, panda_model, columns, words):
    with pytest.raises(RecordingError, match=words) as error:
        read_joints(write_csv(tmp_path / "a.csv", columns), panda_model)
    assert "\n" not in str(error.value)
    assert "a.csv" in str(error.value)


def test_what_is_wrong_with_a_bag_is_said_in_one_line(tmp_path, panda_model):
    for name, messages, words in (
        ("none", wrenches(np.zeros((9, 3))), "has no topic of type sensor_msgs/JointState; it holds /wrench"),
        ("others", states(MOVING[:, :2], ("a", "b")), "names the joints a, b, but panda_joint1, panda_joint2"),
        ("twice", states(np.hstack([MOVING, MOVING]), tuple(f"{a}_joint{i}" for a in "ab" for i in range(1, 8))),
         "names joint 1 twice, 'a_joint1' and 'b_joint1'"),
        ("nan", states(np.full((9, 7), np.nan)), "9 samples are not finite numbers"),
        ("far", states(100 * MOVING), "out of its range of .* check the unit and the arm"),
    ):  # fmt: skip
        with pytest.raises(RecordingError, match=words) as error:
            read_joints(write_bag(tmp_path / name, messages), panda_model)
        assert "\n" not in str(error.value)


def test_a_message_without_positions_is_passed_over(tmp_path, panda_model):
    nothing = np.zeros(0)
    empty = made(
        JOINTS, header=joints(START, Q).header, name=list(PANDA), position=nothing, velocity=nothing, effort=nothing
    )
    found = read_joints(write_bag(tmp_path / "bag", [("/joint_states", START, empty), *states()]), panda_model)
    assert len(found.trace.stamp) == 50


@pytest.mark.parametrize(
    ("name", "topic", "words"),
    [
        ("none.csv", "", "does not exist"),
        ("a.xlsx", "", "has an unknown format: give a file that ends in .mcap, .db3, .bag, .csv"),
        ("folder", "", "has no metadata.yaml"),
        ("a.csv", "/joint_states", "is a table and has no topics: leave out --topic"),
        ("a.csv", "", "is empty"),
        ("a.mcap", "", "cannot be read as a bag or MCAP file"),
    ],
)
def test_what_cannot_be_opened_is_said(tmp_path, panda_model, name, topic, words):
    (tmp_path / "folder").mkdir()
    for there in ("a.xlsx", "a.csv", "a.mcap"):
        (tmp_path / there).touch()
    with pytest.raises(RecordingError, match=words):
        read_joints(tmp_path / name, panda_model, topic)


def test_a_parquet_file_gives_the_joints_that_a_csv_file_does(tmp_path, panda_model):
    time = np.arange(50) / 100.0
    columns = {"time_s": time} | {f"q{j + 1}_deg": np.rad2deg(Q[j] + 0.1 * time) for j in range(7)}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    files = write_csv(tmp_path / "a.csv", columns), tmp_path / "a.parquet"
    read = [read_joints(file, panda_model) for file in files]
    np.testing.assert_allclose(read[1].trace.stamp, read[0].trace.stamp, atol=1e-9)
    np.testing.assert_allclose(read[1].trace.q, read[0].trace.q, atol=1e-9)
    assert read[1].said == "the columns q1_deg to q7_deg"


CELLS = st.sampled_from(["", "0", "0.5", "nan", "1e999", "x", '"', "-1,5", "3"])
NAMES = st.sampled_from(["time_s", "time_ms", "time", "joint_1_rad", *NAMED, "q1_deg", "q99_rad", "_rad", ""])


@given(
    st.one_of(st.just(["time_s", *NAMED]), st.lists(NAMES, max_size=10)),
    st.lists(st.lists(CELLS, min_size=7, max_size=9), max_size=5),
)
def test_junk_gives_joints_in_order_or_our_error_and_nothing_else(tmp_path_factory, panda_model, names, rows):
    file = tmp_path_factory.getbasetemp() / "junk.csv"
    file.write_text("\n".join(";".join(row) for row in [names, *rows]))
    try:
        trace = read_joints(file, panda_model).trace
    except RecordingError as error:
        said = str(error)
    else:
        said = ""
        assert trace.q.shape == (len(trace.stamp), 7)
        assert np.isfinite(trace.q).all()
        assert np.all(np.diff(trace.stamp) > 0)
    assert "\n" not in said
