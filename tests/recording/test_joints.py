"""Joint states in a recording of sensor units."""

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pretouch.errors import RecordingError
from pretouch.recording.skin_reader import read_skin
from pretouch.recording.skin_recording import SkinRecording
from tests.recording.test_skin_recording import record

NAMES = ("panda_joint1", "panda_joint2")
STAMP = 100.0 + np.arange(200) / 1000
Q = np.random.default_rng(0).normal(size=(200, 2))


def recorded(place, *parts):
    """Record units, and joint states in parts: (stamp, q, qd, names)."""
    with SkinRecording(place) as recording:
        for number in range(1, 6):
            record(recording, number)
        for part in parts:
            recording.joints(*part)
    return read_skin(place)


def test_joint_positions_come_back_to_the_bit_with_their_names(tmp_path):
    trace = recorded(tmp_path / "a.mcap", (STAMP[:90], Q[:90], None, NAMES), (STAMP[90:], Q[90:], 0.1 * Q[90:], NAMES))
    np.testing.assert_array_equal(trace.joints.q, Q)
    np.testing.assert_allclose(trace.joints.stamp, STAMP, atol=1e-9)
    assert trace.joint_names == NAMES
    assert trace.complete


def test_the_usual_tools_read_them_as_joint_states(tmp_path):
    recorded(tmp_path / "a.mcap", (STAMP, Q, 0.1 * Q, NAMES))
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        (connection,) = (c for c in reader.connections if c.topic == "/joint_states")
        assert (connection.msgtype, connection.msgcount) == ("sensor_msgs/msg/JointState", 200)
        for (_, time, raw), t, q in zip(reader.messages([connection]), STAMP, Q, strict=True):
            state = reader.deserialize(raw, connection.msgtype)
            assert state.name == list(NAMES)
            assert state.position.tolist() == q.tolist()
            assert state.velocity.tolist() == (0.1 * q).tolist()
            assert not len(state.effort)
            assert time == round(t * 1e9) == state.header.stamp.sec * 10**9 + state.header.stamp.nanosec


def test_a_recording_without_them_has_none(tmp_path):
    trace = recorded(tmp_path / "a.mcap")
    assert trace.joints is None
    assert trace.joint_names == ()


def test_they_are_sorted_and_what_is_no_number_or_came_twice_is_left_out(tmp_path):
    q = Q.copy()
    q[5] = np.nan
    trace = recorded(
        tmp_path / "a.mcap", (STAMP[100:], q[100:], None, NAMES), (STAMP[:101], q[:101] + 1.0, None, NAMES)
    )
    np.testing.assert_array_equal(trace.joints.q, np.delete(np.vstack([q[:101] + 1.0, q[101:]]), 5, axis=0))
    assert np.all(np.diff(trace.joints.stamp) > 0)


def test_another_arm_in_the_same_file_is_refused(tmp_path):
    with pytest.raises(RecordingError, match="states of the joints a, b and of panda_joint1, panda_joint2"):
        recorded(tmp_path / "a.mcap", (STAMP, Q, None, NAMES), (STAMP, Q, None, ("a", "b")))


@pytest.mark.parametrize(
    ("q", "qd", "names"),
    [(Q[:, :1], None, NAMES), (Q[1:], None, NAMES), (Q[:, 0], None, NAMES), (Q, Q[:, :1], NAMES), (Q, None, NAMES[:1])],
)
def test_other_shapes_are_refused_before_anything_is_written(tmp_path, q, qd, names):
    with SkinRecording(tmp_path / "a.mcap") as recording:
        with pytest.raises(RecordingError, match=r"give \(200, [12]\), a row for each instant"):
            recording.joints(STAMP, q, qd, names)
        assert not recording.trouble
