"""What is taken from messages: joints by name, the wrench's sign and frame, ranges, and whether they are new."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from ros2.tests.asking import MESSAGES, header, joint_state, measured_range
from scipy.spatial.transform import Rotation

from pretouch.types import RangeStatus
from pretouch_ros2.inputs import Joints, TorqueEstimate, Wrench
from pretouch_ros2.messages import WRENCH
from pretouch_ros2.params import ArmParams
from pretouch_ros2.skin import status_of
from pretouch_ros2.stamps import SourceStamps

NAMES = ("a", "b", "c")


def wrench(stamp: float, *numbers: float) -> Any:
    pair = MESSAGES.xyz("Vector3", numbers[:3]), MESSAGES.xyz("Vector3", numbers[3:])
    return MESSAGES.make(WRENCH, header(stamp), MESSAGES.make("geometry_msgs/msg/Wrench", *pair))


@pytest.fixture
def joints():
    return Joints(NAMES, SourceStamps())


def test_joints_are_found_by_name_in_any_order_and_beside_others(joints):
    joints.take(joint_state(1, "xcbya", [9, 3, 2, 8, 1], [90, 30, 20, 80, 10]), 5.0, 1)
    assert joints.newest.q.tolist() == [1, 2, 3]
    assert joints.newest.qd.tolist() == [10, 20, 30]
    assert joints.newest.stamp == 5.0


def test_a_message_without_all_of_our_joints_is_another_devices(joints):
    joints.take(joint_state(1, "ab", [1, 2]), 5.0, 1)
    assert joints.newest is None
    assert joints.missing == ("c",)
    joints.take(joint_state(2, "abc", [1, 2, 3]), 6.0, 1)
    joints.take(joint_state(3, "ab", [7, 8]), 7.0, 1)
    assert joints.newest.q.tolist() == [1, 2, 3]
    assert joints.newest.stamp == 6.0


@pytest.mark.parametrize("positions", [[1.0, 2.0], [1.0, 2.0, 3.0, 4.0], []])
def test_positions_that_are_not_one_for_each_name_are_not_taken(joints, positions):
    joints.take(joint_state(1, "abc", positions), 5.0, 1)
    assert joints.newest is None
    assert joints.unequal == f"names 3 joints and has {len(positions)} positions"


@pytest.mark.parametrize("given", [(), [math.nan] * 3])
def test_missing_velocities_are_taken_from_the_positions(joints, given):
    joints.take(joint_state(1, "abc", [1, 2, 3], given), 5.0, 1)
    assert joints.newest.qd.tolist() == [0, 0, 0]
    joints.take(joint_state(2, "abc", [1.1, 2, 2.9], given), 5.1, 1)
    assert joints.newest.qd == pytest.approx([1, 0, -1])
    assert joints.differentiated


def test_a_position_that_is_no_number_is_handed_on_for_the_controller_to_name(joints):
    joints.take(joint_state(1, "abc", [1, math.nan, 3], [0, 0, 0]), 5.0, 1)
    assert np.isnan(joints.newest.q[1])


@pytest.mark.parametrize(
    ("told", "expected"),
    [
        pytest.param([(10, 1.0, 7), (10, 1.1, 7), (9.5, 1.2, 7), (10.01, 1.3, 7)], [1.0, None, None, 1.3], id="late"),
        pytest.param([(10, 1.0, 7), (9.9, 1.1, 8)], [1.0, 1.1], id="another publisher"),
        pytest.param([(9.9, 1.1, 8), (5.0, 1.2, 8), (5.1, 1.3, 8)], [1.1, None, None], id="clock set back"),
        pytest.param([(10, 1.0, 1), (10, 1.1, 2), (10, 1.2, 1), (10, 1.3, 2)], [1.0, 1.1, None, None], id="frozen"),
        pytest.param([(10 - 2 * (k % 2), 1.0 + k, 1) for k in range(9)], [1.0, *[None] * 8], id="alternating"),
        pytest.param([(0, 1.0, 7), (0, 1.1, 7)], [1.0, 1.1], id="no stamps"),
    ],
)
def test_only_what_is_newer_than_what_its_writer_said_before_is_new(told, expected):
    stamps = SourceStamps()
    assert [stamps.instant(header(stamp), received, writer) for stamp, received, writer in told] == expected


def test_a_source_whose_stamps_are_not_newer_is_named_until_one_is():
    stamps, notes = SourceStamps(), []
    told = (10, 5, 5, 11, 1e6, *range(12, 23), 1e6 + 1)  # one repeats, then one from the future mutes others
    for received, stamp in zip(np.arange(len(told)) * 0.06, told, strict=True):
        stamps.instant(header(stamp), received, 7)
        notes.append(stamps.not_newer("/joint_states"))
    assert [bool(note) for note in notes] == [False] * 15 + [True, False]
    assert "/joint_states is stamped no later than before, so it is not used: see whether its source" in notes[-2]


def test_a_repeater_that_sends_each_message_often_is_as_fresh_as_its_source():
    stamps = SourceStamps()
    for k in range(500):  # 250 Hz of a source of 20 Hz
        stamps.instant(header(1 + k // 12), 0.004 * k, 7)
        assert not stamps.not_newer("/twist")


def test_writers_that_publish_at_once_are_noticed_and_one_that_follows_another_is_not():
    stamps = SourceStamps()
    for k in range(3):
        stamps.instant(header(10 + k), 1.0 + k, 1)
    assert not stamps.together()
    stamps.instant(header(13), 4.0, 2)
    assert not stamps.together()
    stamps.instant(header(13.1), 4.1, 1)
    assert stamps.together()


def test_what_strangers_publish_takes_bounded_memory():
    joints, stamps = Joints(("a",), SourceStamps()), SourceStamps()
    for k in range(1000):
        joints.take(SimpleNamespace(name=[f"x{k}"], position=[0.0], velocity=[], header=header(0)), 0.0, 1)
        stamps.instant(header(10), float(k), k)
    joints.take(SimpleNamespace(name=["a"] * 2000, position=[0.0] * 2000, velocity=[], header=header(0)), 0.0, 1)
    assert len(joints.others) <= 65
    assert len(stamps._writers) <= 8
    joints.take(joint_state(1, "a", [1.0]), 5.0, 1)
    assert joints.newest is not None


@pytest.mark.parametrize(("clock", "expected"), [(100.2, 4.8), (100.0, 5.0), (99.0, 5.0)])
def test_with_one_clock_the_headers_age_counts(clock, expected):
    assert SourceStamps(True, lambda: clock).instant(header(100.0), 5.0, 7) == pytest.approx(expected)


def test_how_far_a_clock_is_behind_is_what_the_promptest_message_shows():
    stamps = SourceStamps(now=lambda: 100.0)
    stamps.instant(header(0), 5.0, 7)
    assert stamps.behind is None
    for stamp in (99.5, 99.99, 99.995 - 0.1, 99.996):
        stamps.instant(header(stamp), 5.0, 7)
    assert stamps.behind == pytest.approx(0.004)


@pytest.mark.parametrize(("sign", "factor"), [("on-robot", 1), ("by-robot", -1)])
@pytest.mark.parametrize("frame", ["base", "ee"])
def test_the_wrench_is_brought_to_our_sign_and_frame(sign, factor, frame):
    R = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    taken = Wrench(ArmParams(sign, frame), SourceStamps())
    taken.take(wrench(1, 10, 2, 3, 0.1, 0.2, 0.3), 5.0, 1)
    expected = [10, 2, 3, 0.1, 0.2, 0.3] if frame == "base" else [-2, 10, 3, -0.2, 0.1, 0.3]
    assert taken.read(5.0, R) == pytest.approx(factor * np.array(expected))


@pytest.mark.parametrize(
    ("sign", "zeros", "none"),
    [
        ("by-robot", "auto", True), ("on-robot", "auto", False), ("on-robot", "missing", True),
        ("by-robot", "kept", False),
    ],
)  # fmt: skip
def test_six_zeros_are_no_estimate_where_that_is_set(sign, zeros, none):
    taken = Wrench(ArmParams(sign, "base", zeros), SourceStamps())
    taken.take(wrench(1, *[0.0] * 6), 5.0, 1)
    assert taken.received_any
    assert (taken.read(5.0, np.eye(3)) is None) == none


def test_a_wrench_that_is_old_or_no_number_is_no_estimate():
    taken = Wrench(ArmParams("on-robot", "base"), SourceStamps())
    assert taken.read(5.0, np.eye(3)) is None
    taken.take(wrench(1, 1, 2, 3, 4, 5, 6), 5.0, 1)
    assert taken.read(5.04, np.eye(3)) is not None
    assert taken.read(5.06, np.eye(3)) is None
    taken.take(wrench(2, 1, math.nan, 3, 4, 5, 6), 5.1, 1)
    assert taken.read(5.1, np.eye(3)) is None


@pytest.mark.parametrize(("sign", "factor"), [("on-robot", 1), ("by-robot", -1)])
def test_torques_are_those_of_our_joints_in_our_order_and_sign_while_they_are_new(sign, factor):
    torques = TorqueEstimate(ArmParams(sign, "base", torques="/tau"), NAMES, SourceStamps())
    assert np.isnan(torques.read(5.0)).all()
    torques.take(joint_state(1, "xcab", tau=[9, 3, 1, 2]), 5.0, 1)
    assert torques.read(5.04).tolist() == [factor, factor * 2, factor * 3]
    assert np.isnan(torques.read(5.06)).all()
    torques.take(joint_state(2, "abc", tau=[1, math.nan, 3]), 5.1, 1)
    assert np.isnan(torques.read(5.1)[1])


def test_torques_of_others_or_too_few_are_none_and_zeros_neither_where_they_mean_that():
    torques = TorqueEstimate(ArmParams("by-robot", "base", torques="/tau"), NAMES, SourceStamps())
    torques.take(joint_state(1, "abd", tau=[1, 2, 3]), 5.0, 1)
    torques.take(joint_state(2, "abc", tau=[]), 5.1, 1)
    assert (torques.received_any, torques.others) == (False, ("a", "b", "c"))
    torques.take(joint_state(3, "abc", tau=[0, 0, 0]), 5.2, 1)
    assert torques.received_any
    assert np.isnan(torques.read(5.2)).all()
    kept = TorqueEstimate(ArmParams("on-robot", "base", torques="/tau"), NAMES, SourceStamps())
    kept.take(joint_state(3, "abc", tau=[0, 0, 0]), 5.2, 1)
    assert not kept.read(5.2).any()


@pytest.mark.parametrize(
    ("frame_id", "frame", "doubted"),
    [("fr3_hand_tcp", "base", True), ("fr3_hand_tcp", "ee", False), ("base", "ee", True), ("", "ee", False)],
)
def test_a_frame_id_that_does_not_fit_the_setting_is_named(frame_id, frame, doubted):
    taken = Wrench(ArmParams("on-robot", frame), SourceStamps())
    message = wrench(1, *[1.0] * 6)
    message.header.frame_id = frame_id
    taken.take(message, 5.0, 1)
    assert bool(taken.warning) == doubted


@pytest.mark.parametrize(
    ("distance", "least", "most", "status"),
    [
        (0.5, 0.04, 4.0, RangeStatus.OK),
        (0.04, 0.04, 4.0, RangeStatus.OK),
        (3.99, 0.04, 4.0, RangeStatus.OK),
        (4.0, 0.04, 4.0, RangeStatus.SIGNAL),
        (-1.0, 0.04, 4.0, RangeStatus.NONE),
        (900.0, 40.0, 4000.0, RangeStatus.NONE),
        (4.1, 0.04, 4.0, RangeStatus.SIGNAL),
        (math.inf, 0.04, 4.0, RangeStatus.SIGNAL),
        (0.03, 0.04, 4.0, RangeStatus.MIN_RANGE),
        (-math.inf, 0.04, 4.0, RangeStatus.MIN_RANGE),
        (math.nan, 0.04, 4.0, RangeStatus.NONE),
        (0.5, 0.0, 0.0, RangeStatus.NONE),  # limits not filled in must not read as "nothing near"
        (math.inf, 0.0, 0.0, RangeStatus.NONE),
        (math.inf, math.nan, 4.0, RangeStatus.NONE),
        (-math.inf, 0.5, 0.5, RangeStatus.NONE),
        (1.0, 0.0, math.inf, RangeStatus.OK),
    ],
)
def test_a_range_says_what_rep_117_says(distance, least, most, status):
    assert status_of(measured_range(1, "f", distance, least, most)) is status
