"""Bags of every kind: topics, stamps, joints by name, robot states, and what is wrong with them in one sentence."""

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from scipy.spatial.transform import Rotation

from pretouch.errors import RecordingError
from pretouch.imported_data.log import Choice
from pretouch.imported_data.reading import open_log, read_force, read_joints
from pretouch.units.skin_recording import SkinRecording
from tests.imported_data.files import PANDA, START, by_time, joints, stamps, wrench, wrenches, write_bag

FORCE = np.random.default_rng(0).normal(size=(40, 3))
Q = np.array([0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.7])
MOVING = Q + 0.01 * np.arange(50)[:, None] * np.array([1, 2, -1, 3, 1, -2, 1])
FR3 = tuple(f"fr3_joint{i}" for i in range(1, 8))
NOTHING = np.zeros(0)


def force_of(place, **choice):
    return read_force(open_log(place, Choice(**choice)), Choice(**choice))


def one_file(folder):
    return next(p for p in folder.iterdir() if p.suffix in (".mcap", ".db3"))


def states(q=MOVING, names=PANDA, topic="/joint_states"):
    return [(topic, t + 300_000, joints(t, row, names)) for t, row in zip(stamps(len(q)), q, strict=True)]


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("as_file", [False, True])
def test_bags_of_ros_2_are_read_as_folder_and_as_file(tmp_path, plugin, as_file):
    bag = write_bag(tmp_path / "bag", wrenches(FORCE), plugin)
    recording = force_of(one_file(bag) if as_file else bag)
    np.testing.assert_array_equal(recording.force, FORCE)
    np.testing.assert_allclose(recording.time, (stamps(40) - START) / 1e9)
    assert recording.notes == ()
    assert recording.rate == pytest.approx(100.0)
    assert recording.source == "/wrench"


@pytest.mark.parametrize(
    ("sign", "zeros", "code"),
    [
        ("on-robot", "auto", "zeros_kept"), ("by-robot", "auto", "zeros_missing"),
        ("on-robot", "missing", "zeros_missing"), ("by-robot", "kept", "zeros_kept"),
    ],
)  # fmt: skip
def test_the_sign_is_what_was_said_and_six_zeros_are_no_estimate_where_the_robot_says_so(tmp_path, sign, zeros, code):
    messages = wrenches(FORCE)
    stamp = messages[7][1] - 300_000
    messages[7] = ("/wrench", stamp + 300_000, wrench(stamp, (0, 0, 0), (0, 0, 0)))
    messages[9] = ("/wrench", messages[9][1], wrench(messages[9][1] - 300_000, (0, 0, 0), (0, 0, 1)))
    recording = force_of(write_bag(tmp_path / "bag", messages), sign=sign, zeros=zeros)
    assert recording.by_robot is (sign == "by-robot")
    np.testing.assert_array_equal(recording.force[20:], -FORCE[20:] if recording.by_robot else FORCE[20:])
    gone = np.flatnonzero(np.isnan(recording.force).any(axis=1))
    assert gone.tolist() == ([7] if code == "zeros_missing" else [])
    assert [(note.code, note.values["count"]) for note in recording.notes] == [(code, 1)]


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
    order = [3, 0, 6, 1, 5, 2, 4]
    names = ["fr3_finger_joint1", *(FR3[j] for j in order)]
    messages = wrenches(FORCE, frame="fr3_K")
    for t, s in zip(stamps(40), share, strict=True):
        q = (1 - s) * Q + s * other
        messages.append(("/joint_states", t, joints(t, [0.02, *q[order]], names)))
        messages.append(("/joint_states", t, joints(t, [0.02, 0.02], ["finger_joint1", "finger_joint2"])))
    bag = write_bag(tmp_path / "bag", by_time(messages))
    recording = force_of(bag, frame="ee")
    for f, s, ours in zip(FORCE, share, recording.force, strict=True):
        # the file of the arm has six digits
        np.testing.assert_allclose(ours, hand_rotation((1 - s) * Q + s * other) @ f, atol=1e-5)
    assert recording.model.description.name == "fr3"
    assert [(note.code, note.values["frame"]) for note in force_of(bag).notes] == [("looks_ee", "fr3_K")]


def test_forces_without_a_posture_near_them_are_left_out_in_the_end_effectors_frame(tmp_path):
    messages = wrenches(FORCE) + [("/joint_states", t, joints(t, Q)) for t in stamps(40)[:10]]
    known = np.isfinite(force_of(write_bag(tmp_path / "bag", by_time(messages)), frame="ee").force).all(axis=1)
    assert known[:29].all()
    assert not known[30:].any()


def test_of_several_topics_one_has_to_be_named(tmp_path):
    bag = write_bag(tmp_path / "bag", wrenches(FORCE, "/base") + wrenches(2 * FORCE, "/tool"))
    with pytest.raises(
        RecordingError, match=r"several topics of geometry_msgs/WrenchStamped: .*--wrench, /base, /tool"
    ):
        force_of(bag)
    np.testing.assert_array_equal(force_of(bag, wrench="/tool").force, 2 * FORCE)
    with pytest.raises(RecordingError, match=r"no topic '/hand' of .*: choose --wrench from /base, /tool"):
        force_of(bag, wrench="/hand")


def test_the_arm_that_moved_is_chosen_by_its_topic_and_what_was_desired_is_not_taken(tmp_path, panda_model):
    messages = states(topic="/a") + states(MOVING + 0.2, topic="/desired") + wrenches(FORCE)
    bag = write_bag(tmp_path / "one", messages)
    np.testing.assert_array_equal(read_joints(bag, panda_model)[0].q, MOVING)
    bag = write_bag(tmp_path / "two", messages + states(MOVING + 0.1, topic="/b"))
    force_of(bag)
    np.testing.assert_array_equal(read_joints(bag, panda_model, "/b")[0].q, MOVING + 0.1)
    words = r"several topics of sensor_msgs/JointState: choose one by --joints \(--topic of .*, /a, /b, /desired"
    for read in (lambda: read_joints(bag, panda_model), lambda: force_of(bag, frame="ee")):
        with pytest.raises(RecordingError, match=words):
            read()


def test_joints_are_in_the_order_of_the_arm_and_a_gripper_is_passed_over(tmp_path, panda_model):
    gripper = states(np.zeros((50, 2)), ("gripper_left", "gripper_right"))
    arm = states(MOVING[:, ::-1], PANDA[::-1])
    messages = [m for pair in zip(gripper, arm, strict=True) for m in pair]
    trace, log = read_joints(write_bag(tmp_path / "bag", messages), panda_model)
    np.testing.assert_array_equal(trace.q, MOVING)
    np.testing.assert_allclose(trace.stamp, START / 1e9 + np.arange(50) / 100, atol=1e-6)
    assert log.sources["q"] == "/joint_states"
    assert log.notes == ()


def test_states_without_names_are_those_of_the_arm_if_there_are_as_many(tmp_path, panda_model):
    np.testing.assert_array_equal(read_joints(write_bag(tmp_path / "bag", states(names=())), panda_model)[0].q, MOVING)


def test_a_recording_of_our_own_is_a_bag_too(tmp_path, panda_model):
    with SkinRecording(tmp_path / "own.mcap") as recording:
        recording.joints(np.arange(50) / 100 + 7.0, MOVING, None, PANDA)
    trace, _ = read_joints(tmp_path / "own.mcap", panda_model)
    np.testing.assert_array_equal(trace.q, MOVING)
    np.testing.assert_allclose(trace.stamp, np.arange(50) / 100 + 7.0, atol=1e-9)


def test_what_is_wrong_with_joints_is_said_in_one_sentence(tmp_path, panda_model):
    for name, messages, words in (
        ("none", wrenches(FORCE), "has no topic of sensor_msgs/JointState; it holds /wrench"),
        ("parts", states(MOVING[:, :4], PANDA[:4]) + states(MOVING[:, 4:], PANDA[4:]), "No message on /joint_states"),
        ("nan", states(np.full((9, 7), np.nan)), "has joint states without a position for each joint"),
        ("far", states(100 * MOVING), "out of its range of .* check the unit and the arm"),
    ):
        with pytest.raises(RecordingError, match=words) as error:
            read_joints(write_bag(tmp_path / name, messages), panda_model)
        assert "\n" not in str(error.value)


def test_a_message_without_positions_is_passed_over(tmp_path, panda_model):
    empty = joints(START, NOTHING)
    trace, _ = read_joints(write_bag(tmp_path / "bag", [("/joint_states", START, empty), *states()]), panda_model)
    assert len(trace.stamp) == 50


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_file_cut_off_is_read_or_refused_in_one_sentence(tmp_path, share, plugin):
    file = one_file(write_bag(tmp_path / "bag", wrenches(FORCE), plugin))
    content = file.read_bytes()
    file.write_bytes(content[: int(share * len(content))])
    sentence = str(file)
    try:
        assert len(force_of(file).force) <= 40
    except RecordingError as refused:
        sentence = str(refused)
    assert str(file) in sentence
    assert "\n" not in sentence
