"""Bags of every kind: topics, stamps, sign, frame and zeros, and what is wrong with them in one sentence."""

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation

from pretouch.errors import RecordingError
from pretouch.imported_data.samples import read_imported
from pretouch.imported_data.source import Choice
from tests.imported_data.files import (
    START,
    STORE1,
    joints,
    stamps,
    wrench,
    wrenches,
    write_bag,
    write_bag1,
)

FORCE = np.random.default_rng(0).normal(size=(40, 3))
Q = np.array([0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.7])


def read_or_refused(file):
    """Return what was read, or our error's sentence; any other exception is a failure."""
    try:
        return read_imported(file, Choice())
    except RecordingError as error:
        return str(error)


def one_file(folder):
    return next(p for p in folder.iterdir() if p.suffix in (".mcap", ".db3"))


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("as_file", [False, True])
def test_bags_of_ros_2_are_read_as_folder_and_as_file(tmp_path, plugin, as_file):
    bag = write_bag(tmp_path / "bag", wrenches(FORCE), plugin)
    found = read_imported(one_file(bag) if as_file else bag, Choice())
    np.testing.assert_array_equal(found.force.values, FORCE)
    np.testing.assert_array_equal(found.force.time, stamps(40))
    assert found.notes == ()
    assert found.rate == pytest.approx(100.0)
    assert "the topic /wrench" in found.said


def test_bags_of_ros_1_are_read(tmp_path):
    messages = [("/wrench", t, wrench(t, f, store=STORE1)) for t, f in zip(stamps(40), FORCE, strict=True)]
    found = read_imported(write_bag1(tmp_path / "old.bag", messages), Choice())
    np.testing.assert_array_equal(found.force.values, FORCE)


def test_the_sign_is_what_was_said_and_is_said_again(tmp_path):
    bag = write_bag(tmp_path / "bag", wrenches(FORCE))
    on, by = (read_imported(bag, Choice(sign=sign)) for sign in ("on-robot", "by-robot"))
    np.testing.assert_array_equal(on.force.values, FORCE)
    np.testing.assert_array_equal(by.force.values, -FORCE)
    assert (
        "assumed to be the force on the robot (otherwise --sign by-robot) in the base frame (otherwise --frame ee)"
        in on.said
    )
    assert "assumed to be the force by the robot (otherwise --sign on-robot)" in by.said


@pytest.mark.parametrize(
    ("sign", "zeros", "missing"),
    [
        ("on-robot", "auto", False), ("by-robot", "auto", True),
        ("on-robot", "missing", True), ("by-robot", "kept", False),
    ],
)  # fmt: skip
def test_wrenches_of_zeros_only_are_no_estimate_where_the_robot_says_so(tmp_path, sign, zeros, missing):
    messages = wrenches(FORCE)
    stamp = messages[7][1] - 300_000
    messages[7] = ("/wrench", stamp + 300_000, wrench(stamp, (0, 0, 0), (0, 0, 0)))
    messages[9] = ("/wrench", messages[9][1], wrench(messages[9][1] - 300_000, (0, 0, 0), (0, 0, 1)))
    found = read_imported(write_bag(tmp_path / "bag", messages), Choice(sign=sign, zeros=zeros))
    gone = np.flatnonzero(np.isnan(found.force.values).any(axis=1))
    assert gone.tolist() == ([7] if missing else [])
    assert any("1 sample is all zeros" in note for note in found.notes)


def hand_rotation(q):
    """R_O_tcp of a Panda from the vendor's table of modified Denavit-Hartenberg parameters, hand turned by -45 deg."""
    alphas = np.array([0, -1, 1, 1, -1, 1, 1]) * np.pi / 2
    total = Rotation.identity()
    for alpha, theta in zip(alphas, q, strict=True):
        total = total * Rotation.from_euler("x", alpha) * Rotation.from_euler("z", theta)
    return (total * Rotation.from_euler("z", -np.pi / 4)).as_matrix()


def test_a_force_in_the_end_effectors_frame_is_turned_by_the_arms_posture(tmp_path):
    other = Q + np.linspace(0.0, 0.3, 7)
    share = np.linspace(0, 1, 40)
    names = [f"fr3_joint{j}" for j in range(1, 8)]
    order = [3, 0, 6, 1, 5, 2, 4]
    messages = wrenches(FORCE, frame="fr3_K")
    for t, s in zip(stamps(40), share, strict=True):
        q = (1 - s) * Q + s * other
        messages.append(
            ("/joint_states", t, joints(t, [0.02, *q[order]], ["fr3_finger_joint1", *(names[j] for j in order)]))
        )
        messages.append(("/joint_states", t, joints(t, [0.02, 0.02], ["finger_joint1", "finger_joint2"])))
    bag = write_bag(tmp_path / "bag", sorted(messages, key=lambda m: m[1]))
    found = read_imported(bag, Choice(frame="ee"))
    for f, s, ours in zip(FORCE, share, found.force.values, strict=True):
        np.testing.assert_allclose(
            ours, hand_rotation((1 - s) * Q + s * other) @ f, atol=1e-5
        )  # the file of the arm has six digits
    assert "The arm is assumed to be fr3" in found.said
    (said,) = read_imported(bag, Choice()).notes
    assert "frame_id is 'fr3_K'" in said
    assert "--frame ee" in said


def test_forces_without_a_posture_near_them_are_left_out_in_the_end_effectors_frame(tmp_path):
    messages = wrenches(FORCE) + [("/joint_states", t, joints(t, Q)) for t in stamps(40)[:10]]
    found = read_imported(write_bag(tmp_path / "bag", sorted(messages, key=lambda m: m[1])), Choice(frame="ee"))
    known = np.isfinite(found.force.values).all(axis=1)
    assert known[:29].all()
    assert not known[30:].any()


def test_of_several_topics_one_has_to_be_named(tmp_path):
    bag = write_bag(tmp_path / "bag", wrenches(FORCE, "/base") + wrenches(2 * FORCE, "/tool"))
    with pytest.raises(
        RecordingError, match=r"several topics of geometry_msgs/WrenchStamped: .*--wrench, /base, /tool"
    ):
        read_imported(bag, Choice())
    np.testing.assert_array_equal(read_imported(bag, Choice(wrench="/tool")).force.values, 2 * FORCE)
    with pytest.raises(RecordingError, match=r"no topic '/hand' of .*: choose --wrench from /base, /tool"):
        read_imported(bag, Choice(wrench="/hand"))


def test_of_several_topics_of_joints_one_has_to_be_named_only_if_they_are_needed(tmp_path):
    messages = wrenches(FORCE)
    for topic, q in (("/measured", Q), ("/desired", Q + 0.1)):
        messages += [(topic, t, joints(t, q)) for t in stamps(40)]
    bag = write_bag(tmp_path / "bag", messages)
    read_imported(bag, Choice())
    with pytest.raises(RecordingError, match=r"sensor_msgs/JointState: choose one by --joints, /desired, /measured"):
        read_imported(bag, Choice(frame="ee"))
    found = read_imported(bag, Choice(frame="ee", joints="/desired"))
    np.testing.assert_array_equal(found.joints.values, np.tile(Q + 0.1, (40, 1)))


def test_a_bag_without_forces_says_what_it_holds(tmp_path):
    bag = write_bag(tmp_path / "bag", [("/joint_states", START, joints(START, Q))])
    with pytest.raises(
        RecordingError, match=r"no topic of type .*WrenchStamped; it holds /joint_states \(sensor_msgs/Joint"
    ):
        read_imported(bag, Choice())


def test_joints_of_another_arm_are_named(tmp_path):
    messages = [*wrenches(FORCE), ("/j", START, joints(START, [0, 1], ["shoulder_pan_joint", "elbow_joint"]))]
    with pytest.raises(RecordingError, match="names the joints shoulder_pan_joint, elbow_joint, but those"):
        read_imported(write_bag(tmp_path / "bag", messages), Choice(frame="ee"))


def test_disorder_and_doubles_are_put_right_and_counted(tmp_path):
    messages = wrenches(FORCE)
    messages[3], messages[4] = messages[4], messages[3]
    stamp = messages[10][1] - 300_000
    messages.insert(11, ("/wrench", messages[10][1] + 1, wrench(stamp, (9, 9, 9))))
    late = [("/wrench", START + i * 10_000_000 + 300_000, m) for i, (_, _, m) in enumerate(messages)]
    found = read_imported(write_bag(tmp_path / "bag", late), Choice())
    expected = FORCE.copy()
    expected[10] = 9
    np.testing.assert_array_equal(found.force.values, expected)
    np.testing.assert_array_equal(found.force.time, stamps(40))
    assert found.notes == (
        "Force: the time went backwards once; the samples were sorted.",
        "Force: a stamp was repeated once; the later sample counts.",
    )


@pytest.mark.parametrize(("shift", "words"), [(None, "Some headers have no stamp"), (3600, "drift 3.6e+03 s apart")])
def test_headers_that_cannot_be_believed_give_way_to_the_times_of_recording(tmp_path, shift, words):
    messages = wrenches(FORCE)
    for _, _, message in messages[5:7]:
        stamp = message.header.stamp
        stamp.sec, stamp.nanosec = (0, 0) if shift is None else (stamp.sec + shift, stamp.nanosec)
    found = read_imported(write_bag(tmp_path / "bag", messages), Choice())
    np.testing.assert_array_equal(found.force.time, stamps(40) + 300_000)
    assert words in found.notes[0]


def test_a_simulation_may_begin_at_zero(tmp_path):
    messages = [("/wrench", int(t), wrench(t, f)) for t, f in zip(stamps(40) - START, FORCE, strict=True)]
    assert read_imported(write_bag(tmp_path / "bag", messages), Choice()).notes == ()


def test_headers_of_another_clock_that_keeps_pace_are_believed(tmp_path):
    messages = [(topic, time + 10**15, m) for topic, time, m in wrenches(FORCE)]
    found = read_imported(write_bag(tmp_path / "bag", messages), Choice())
    np.testing.assert_array_equal(found.force.time, stamps(40))
    assert found.notes == ()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("gone.mcap", None, "does not exist"),
        ("empty.mcap", b"", "cannot be read as a bag"),
        ("junk.mcap", b"\x89MCAP0\r\n" + bytes(range(256)) * 4, "cannot be read as a bag"),
        ("junk.db3", b"SQLite format 3\0" + bytes(200), "cannot be read as a bag"),
        ("junk.bag", b"#ROSBAG V2.0\n" + bytes(200), "cannot be read as a bag"),
        ("text.pdf", b"text", "has an unknown format: give a file that ends in .mcap, .db3, .bag, .csv"),
        ("x" * 300, None, "does not exist"),
    ],
)
def test_files_that_are_no_recording_are_one_sentence(tmp_path, name, content, words):
    file = tmp_path / name
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(RecordingError, match=words) as error:
        read_imported(file, Choice())
    assert "\n" not in str(error.value)


def test_a_folder_without_metadata_is_no_bag(tmp_path):
    with pytest.raises(RecordingError, match=r"has no metadata\.yaml"):
        read_imported(tmp_path, Choice())


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_file_cut_off_is_read_or_refused_in_one_sentence(tmp_path, share, plugin):
    file = one_file(write_bag(tmp_path / "bag", wrenches(FORCE), plugin))
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    found = read_or_refused(file)
    if isinstance(found, str):
        assert str(file) in found
        assert "\n" not in found
    else:
        assert len(found.force) <= 40


def test_a_file_with_flipped_bytes_is_read_or_refused_in_one_sentence(tmp_path):
    file = one_file(write_bag(tmp_path / "bag", wrenches(FORCE)))
    content, random = bytearray(file.read_bytes()), np.random.default_rng(4)
    for _ in range(60):
        broken = bytearray(content)
        for place in random.integers(0, len(content), 3):
            broken[place] = random.integers(256)
        file.write_bytes(broken)
        found = read_or_refused(file)
        assert not isinstance(found, str) or "\n" not in found
