"""Joint torques in bags: efforts of joint states, and the robot states of franka_ros and franka_ros2."""

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pretouch.errors import RecordingError
from pretouch.imported_data.held import holds_force, holds_torques
from pretouch.imported_data.joint_source import JointSource
from pretouch.imported_data.source import Choice
from pretouch.imported_data.torques import read_torques
from tests.imported_data.files import JOINTS, PANDA, START, STORE1, header, made, wrench, write_bag
from tests.imported_data.joint_files import Moving

FR3 = tuple(f"fr3_joint{i}" for i in range(1, 8))
NOTHING = np.zeros(0)
STATE = "franka_msgs/msg/FrankaState"
FIELDS = "std_msgs/Header header\nfloat64[7] q\nfloat64[7] dq\nfloat64[7] dq_d\nfloat64[7] tau_ext_hat_filtered\n"
STATE2 = "franka_msgs/msg/FrankaRobotState"
FIELDS2 = (
    "std_msgs/Header header\nsensor_msgs/JointState measured_joint_state\nsensor_msgs/JointState desired_joint_state\n"
    "sensor_msgs/JointState tau_ext_hat_filtered\n"
)


@pytest.fixture(scope="module")
def short(panda_model):
    return Moving(panda_model, 4.0, rate=100.0)


def stamps(moving):
    return START + np.round(moving.time * 1e9).astype(np.int64)


def state(stamp, names, position=NOTHING, velocity=NOTHING, effort=NOTHING):
    return made(
        JOINTS, header=header(stamp), name=list(names), position=np.array(position), velocity=np.array(velocity),
        effort=np.array(effort),
    )  # fmt: skip


def measured(moving, topic="/joint_states", names=PANDA, order=range(7), effort=True):
    rows = zip(stamps(moving), moving.q, moving.qd, moving.driving, strict=True)
    pick, named = list(order), [names[j] for j in order]
    return [
        (topic, t + 200_000, state(t, named, q[pick], v[pick], e[pick] if effort else NOTHING)) for t, q, v, e in rows
    ]


def external(moving, topic="/broadcaster/external_joint_torques", names=PANDA):
    rows = zip(stamps(moving), -moving.tau_ext, strict=True)
    return [(topic, t + 300_000, state(t, names, effort=e)) for t, e in rows]


def in_order(*parts):
    return sorted((m for part in parts for m in part), key=lambda m: m[1])


def test_efforts_of_joint_states_are_measured_torques_whatever_the_order_of_names(tmp_path, short):
    fingers = [("/joint_states", t, state(t, ("finger_joint1",), [0.01], [0.0], [0.0])) for t in stamps(short)]
    bag = write_bag(tmp_path / "bag", in_order(measured(short, order=[2, 1, 0, 6, 5, 4, 3]), fingers))
    assert holds_torques(bag, Choice())
    assert not holds_force(bag, Choice())
    recording = read_torques(bag, Choice())
    np.testing.assert_allclose(recording.q, short.q)
    np.testing.assert_allclose(recording.qd, short.qd)
    assert "Measured torques" in recording.said
    assert np.nanstd(recording.tau_ext - short.tau_ext, axis=0).max() < 1.0


def test_joints_are_in_the_order_of_the_model_by_their_names(tmp_path, short):
    names = tuple(f"left_{name}" for name in PANDA)
    kinds = {"q": short.q[:, ::-1], "tau": short.driving[:, ::-1]}
    source = JointSource("", stamps(short), kinds, False, "auto", (), names[::-1])
    np.testing.assert_array_equal(source.ordered(PANDA).joints["q"], short.q)
    assert source.ordered(FR3) is source


def test_external_torques_of_franka_ros2_are_by_the_robot_and_take_positions_from_the_joint_states(tmp_path, short):
    messages = in_order(external(short, names=FR3), measured(short, names=FR3))
    bag = write_bag(tmp_path / "bag", messages)
    recording = read_torques(bag, Choice())
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.q, short.q, atol=1e-6)
    assert "The arm is assumed to be fr3" in recording.said
    assert "by the robot (otherwise --sign on-robot)" in recording.said
    raw = read_torques(bag, Choice(torques="/joint_states"))
    assert "Measured torques" in raw.said


def test_beside_a_force_only_what_is_surely_torques_counts(tmp_path, short):
    forces = [("/wrench", t, wrench(t, (1.0, 0.0, 0.0))) for t in stamps(short)]
    beside = write_bag(tmp_path / "beside", in_order(forces, measured(short)))
    assert holds_force(beside, Choice())
    assert not holds_torques(beside, Choice())
    both = write_bag(tmp_path / "both", in_order(forces, measured(short), external(short)))
    assert holds_torques(both, Choice())


@pytest.mark.parametrize(
    ("messages", "choice", "words"),
    [
        (lambda m: external(m), {}, "has no positions: name the topic that has by --joints"),
        (lambda m: in_order(measured(m), measured(m, topic="/other")), {}, "several topics of joint torques"),
        (lambda m: measured(m), {"torques": "/gone"}, "has no topic '/gone' of sensor_msgs/JointState"),
        (lambda m: measured(m), {"joints": "/gone"}, "has no topic '/gone' of sensor_msgs/JointState: choose another"),
        (lambda m: measured(m, effort=False), {}, "has no efforts of the joints"),
    ],
)
def test_topics_that_are_not_clear_are_one_sentence(tmp_path, short, messages, choice, words):
    bag = write_bag(tmp_path / "bag", messages(short))
    with pytest.raises(RecordingError, match=words) as caught:
        read_torques(bag, Choice(**choice))
    assert "\n" not in str(caught.value)


def test_the_robot_state_of_franka_ros_is_read_from_a_bag_of_ros_1(tmp_path, short):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(FIELDS, STATE))
    with Writer1(tmp_path / "old.bag") as writer:
        connection = writer.add_connection("/franka_state_controller/franka_states", STATE, typestore=store)
        rows = zip(stamps(short), short.q, short.qd, short.qd_d, -short.tau_ext, strict=True)
        for t, q, dq, dq_d, tau in rows:
            message = store.types[STATE](header(t, store=STORE1), q, dq, dq_d, tau)
            writer.write(connection, int(t), store.serialize_ros1(message, STATE))
    recording = read_torques(tmp_path / "old.bag", Choice())
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.qd_commanded, short.qd_d)


def test_the_robot_state_of_franka_ros2_is_read(tmp_path, short):
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(FIELDS2, STATE2))
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/franka_robot_state_broadcaster/robot_state", STATE2, typestore=store)
        rows = zip(stamps(short), short.q, short.qd, short.qd_d, -short.tau_ext, strict=True)
        for t, q, dq, dq_d, tau in rows:
            parts = [state(t, FR3, q, dq), state(t, FR3, q, dq_d), state(t, FR3, effort=tau)]
            message = store.types[STATE2](header(t), *parts)
            writer.write(connection, int(t), store.serialize_cdr(message, STATE2))
    assert holds_torques(tmp_path / "bag", Choice())
    recording = read_torques(tmp_path / "bag", Choice())
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.qd_commanded, short.qd_d)
