"""Joint torques in bags: efforts, external torques and robot states of franka_ros, and topics that are not clear."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from pretouch.errors import RecordingError
from pretouch.imported_data.log import Choice
from pretouch.imported_data.reading import open_log
from pretouch.imported_data.torques import torque_recording
from tests.imported_data.files import PANDA, START, STORE1, by_time, header, joints, wrench, write_bag, write_bag1
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


def torques_of(place, **choice):
    return torque_recording(open_log(place, Choice(**choice)).torques(), Choice(**choice))


@pytest.fixture(scope="module")
def short(panda_model):
    return Moving(panda_model, 4.0, rate=100.0)


def of_motion(moving):
    return START + np.round(moving.time * 1e9).astype(np.int64)


def measured(moving, topic="/joint_states", names=PANDA, order=range(7), effort=True):
    rows = zip(of_motion(moving), moving.q, moving.qd, moving.driving, strict=True)
    pick, named = list(order), [names[j] for j in order]
    return [
        (topic, t + 200_000, joints(t, q[pick], named, v[pick], e[pick] if effort else NOTHING)) for t, q, v, e in rows
    ]


def external(moving, topic="/broadcaster/external_joint_torques", names=PANDA):
    rows = zip(of_motion(moving), -moving.tau_ext, strict=True)
    return [(topic, t + 300_000, joints(t, NOTHING, names, effort=e)) for t, e in rows]


def test_efforts_of_joint_states_are_measured_torques_whatever_the_order_of_names(tmp_path, short):
    fingers = [("/joint_states", t, joints(t, [0.01], ["finger_joint1"], [0.0], [0.0])) for t in of_motion(short)]
    bag = write_bag(tmp_path / "bag", by_time(measured(short, order=[2, 1, 0, 6, 5, 4, 3]), fingers))
    assert open_log(bag, Choice()).kinds == {"q"}
    recording = torques_of(bag)
    np.testing.assert_allclose(recording.q, short.q)
    np.testing.assert_allclose(recording.qd, short.qd)
    assert recording.kind == "tau"
    assert np.nanstd(recording.tau_ext - short.tau_ext, axis=0).max() < 1.0


def test_external_torques_of_franka_ros2_are_by_the_robot_and_take_positions_from_the_joint_states(tmp_path, short):
    desired = measured(short, "/desired_joint_states", FR3)
    bag = write_bag(tmp_path / "bag", by_time(external(short, names=FR3), measured(short, names=FR3), desired))
    recording = torques_of(bag)
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.q, short.q, atol=1e-6)
    assert recording.model.description.name == "fr3"
    assert recording.by_robot
    assert recording.sources == ("/broadcaster/external_joint_torques", "/joint_states")
    assert torques_of(bag, torques="/joint_states").kind == "tau"


def test_beside_a_force_only_what_is_surely_torques_counts(tmp_path, short):
    forces = [("/wrench", t, wrench(t, (1.0, 0.0, 0.0))) for t in of_motion(short)]
    beside = write_bag(tmp_path / "beside", by_time(forces, measured(short)))
    assert open_log(beside, Choice()).kinds == {"force", "q"}
    both = write_bag(tmp_path / "both", by_time(forces, measured(short), external(short)))
    assert open_log(both, Choice()).kinds == {"force", "q", "tau_ext"}


@pytest.mark.parametrize(
    ("messages", "choice", "words"),
    [
        (lambda m: external(m), {}, "has joint torques, on /broadcaster/.*, but no joint positions"),
        (lambda m: by_time(measured(m), measured(m, "/other")), {}, "several topics of .*: choose one by --torques"),
        (lambda m: measured(m), {"torques": "/gone"}, "has no topic '/gone' of sensor_msgs/JointState"),
        (lambda m: measured(m), {"joints": "/gone"}, "has no topic '/gone' of sensor_msgs/JointState: choose --joints"),
        (lambda m: measured(m, effort=False), {}, "has no efforts of the joints"),
    ],
)
def test_topics_that_are_not_clear_are_one_sentence(tmp_path, short, messages, choice, words):
    bag = write_bag(tmp_path / "bag", messages(short))
    with pytest.raises(RecordingError, match=words) as caught:
        torques_of(bag, **choice)
    assert "\n" not in str(caught.value)


def test_the_robot_state_of_franka_ros_is_read_from_a_bag_of_ros_1(tmp_path, short):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(FIELDS, STATE))
    rows = zip(of_motion(short), short.q, short.qd, short.qd_d, -short.tau_ext, strict=True)
    messages = [("/states", t, store.types[STATE](header(t, store=STORE1), *arrays)) for t, *arrays in rows]
    bag = write_bag1(tmp_path / "old.bag", messages, store)
    recording = torques_of(bag)
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.qd_commanded, short.qd_d)
    np.testing.assert_allclose(open_log(bag, Choice()).positions().arrays["q"], short.q)


def test_the_robot_state_of_franka_ros2_is_read(tmp_path, short):
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(FIELDS2, STATE2))
    messages = []
    for t, q, dq, dq_d, tau in zip(of_motion(short), short.q, short.qd, short.qd_d, -short.tau_ext, strict=True):
        parts = [joints(t, q, FR3, dq), joints(t, q, FR3, dq_d), joints(t, NOTHING, FR3, effort=tau)]
        messages.append(("/states", t, store.types[STATE2](header(t), *parts)))
    bag = write_bag(tmp_path / "bag", messages, store=store)
    assert "tau_ext" in open_log(bag, Choice()).kinds
    recording = torques_of(bag)
    np.testing.assert_allclose(recording.tau_ext, short.tau_ext)
    np.testing.assert_allclose(recording.qd_commanded, short.qd_d)
