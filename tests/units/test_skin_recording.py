"""What sensor units sent, recorded without a controller."""

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pretouch import cli
from pretouch.errors import RecordingError
from pretouch.recording.reader import open_recording
from pretouch.sensing.unit import ACCELERATION_LSB, ANGULAR_RATE_LSB
from pretouch.units.skin_recording import SkinRecording, SkinTrace, read_skin
from pretouch.units.unit import Received, imu_batch
from pretouch.units.wire import IMU_SAMPLE, Flag, Sample, TouchPart
from tests.following_arm import controller_of
from tests.recording.runs import changed, recorded_run

BATCH = 8


def sample(number: int, unit: int = 1) -> Sample:
    rng = np.random.default_rng([unit, number])
    imu = rng.integers(-32768, 32767, (BATCH, 6), dtype=np.int16).astype("<i2").tobytes()
    touch = b"" if number % 3 else TouchPart(1, 0, 700, 2500, 300).encode()
    flags = (Flag.RANGE_NEW if number % 4 else 0) | (Flag.TOUCH if touch else 0)
    return Sample(
        unit=unit, flags=flags, sequence=number, time_us=20_000 * number + 5,
        beacon=3, beacon_hold_us=77, battery_mv=3700, temperature_cdeg=-512, bus_errors=2, range_stream=number % 256,
        range_status=0 if number % 7 else 4, range_mm=500 + number, range_age_us=9000, range_sigma=12, range_signal=800,
        range_ambient=20, range_spads=4000, imu_count=BATCH, imu_scale=0x21, imu_rate_hz=416, imu_index=BATCH * number,
        imu_age_us=1200, imu=imu, touch=touch,
    )  # fmt: skip


def arrival(number: int) -> float:
    return 100.0 + 0.02 * number


def stamp(number: int) -> float:
    return arrival(number) - 0.015 if number > 2 else math.nan


def heard(number: int, **changes) -> Received:
    return Received(0, arrival(number), stamp(number), 90.0, 1e-4, replace(sample(number), **changes))


def record(recording: SkinRecording, number: int, unit: str = "hand/1") -> None:
    recording.add([heard(number)], [unit])


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("skin") / "units.mcap"
    with SkinRecording(place) as recording:
        for number in range(1, 101):
            record(recording, number)
            record(recording, number, "wrist")
    return place


def test_every_field_of_every_sample_comes_back(place):
    trace = read_skin(place)
    assert trace.complete
    assert list(trace.units) == ["hand/1", "wrist"]
    for index, unit in enumerate(trace.units.values()):
        assert len(unit.samples) == 100
        for number, received in enumerate(unit.samples, 1):
            sent = heard(number)
            assert received.sample == sent.sample
            assert (received.unit, received.arrival) == (index, sent.arrival)
            assert received.stamp == sent.stamp or number <= 2
            assert (received.offset, received.bound) == (90.0, 1e-4)


def read_back(place, received, *joints) -> SkinTrace:
    """Record samples of a unit, and states of joints in parts: (stamp, q, qd, names)."""
    with SkinRecording(place) as recording:
        recording.add(received, ["hand/1"])
        for part in joints:
            recording.joints(*part)
    return read_skin(place)


def test_imu_samples_come_back_as_arrays_with_their_instants(tmp_path):
    received = [heard(n) for n in range(1, 80)]
    unit = read_back(tmp_path / "a.mcap", received).units["hand/1"]
    batches = [imu_batch(one) for one in received]
    np.testing.assert_array_equal(unit.imu.acceleration, np.concatenate([b.acceleration for b in batches]))
    np.testing.assert_array_equal(unit.imu.angular_velocity, np.concatenate([b.angular_velocity for b in batches]))
    # eight samples in 20 ms: the sensor is 4 % off its nominal rate
    newest = [90.0 + 1e-6 * (one.sample.time_us - one.sample.imu_age_us) for one in received]
    true = np.add.outer(newest, 2.5e-3 * np.arange(1 - BATCH, 1)).ravel()
    np.testing.assert_allclose(unit.imu.stamp, true, atol=1e-9)


@pytest.mark.parametrize("acceleration", range(4))
@pytest.mark.parametrize("rate", range(5))
def test_full_scales_are_the_largest_values_a_sensor_can_tell(tmp_path, acceleration, rate):
    full, scale = IMU_SAMPLE.pack(*[32767] * 6), acceleration | rate << 4
    unit = read_back(tmp_path / "a.mcap", [heard(1, imu=full, imu_count=1, imu_scale=scale)]).units["hand/1"]
    range_g, range_dps = list(ACCELERATION_LSB)[acceleration], list(ANGULAR_RATE_LSB)[rate]
    assert unit.acceleration_max == pytest.approx(9.80665 * range_g, rel=1e-3)
    assert np.deg2rad(range_dps) < unit.angular_velocity_max < 1.2 * np.deg2rad(range_dps)
    assert unit.imu.acceleration.max() == unit.acceleration_max
    assert unit.imu.angular_velocity.max() == unit.angular_velocity_max


def test_of_two_scales_the_smaller_is_the_full_scale_and_one_there_is_not_is_left_out(tmp_path):
    received = [heard(number, imu_scale=scale) for number, scale in ((1, 0x21), (2, 0x42), (3, 0x51))]
    unit = read_back(tmp_path / "a.mcap", received).units["hand/1"]
    assert unit.acceleration_max == pytest.approx(4 * 9.80665, rel=1e-3)
    assert unit.angular_velocity_max == pytest.approx(np.deg2rad(573.4), rel=1e-3)
    assert len(unit.imu.stamp) == 2 * BATCH


def test_imu_samples_of_unknown_time_have_their_places_and_a_unit_without_an_imu_has_none(tmp_path):
    received = [replace(heard(1), offset=np.nan), *(heard(n) for n in range(2, 80))]
    unit = read_back(tmp_path / "a.mcap", received).units["hand/1"]
    assert np.isnan(unit.imu.stamp).tolist() == [True] * BATCH + [False] * 78 * BATCH
    unit = read_back(tmp_path / "b.mcap", [heard(1, imu_count=0, imu=b"")]).units["hand/1"]
    assert (len(unit.imu.stamp), unit.acceleration_max) == (0, np.inf)


def test_the_usual_tools_read_the_standard_topics(place):
    with AnyReader([place]) as reader:
        counts = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
        assert counts == {
            "/skin/hand_1/sample": ("pretouch_msgs/msg/UnitSample", 100),
            "/skin/hand_1/range": ("sensor_msgs/msg/Range", 73),  # without the two whose stamps were not known yet
            "/skin/hand_1/imu": ("sensor_msgs/msg/Imu", 800),
            "/skin/wrist/sample": ("pretouch_msgs/msg/UnitSample", 100),
            "/skin/wrist/range": ("sensor_msgs/msg/Range", 73),
            "/skin/wrist/imu": ("sensor_msgs/msg/Imu", 800),
        }
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/skin/wrist/range":
                assert 0.5 < message.range < 0.61 or math.isinf(message.range)
            if connection.topic == "/skin/wrist/imu":
                at = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
                assert (message.header.frame_id, 90.0 < at < 93.0) == ("wrist", True)


@pytest.mark.parametrize("command", [("replay", "--no-page"), ("report",)])
def test_other_commands_say_what_can_be_done_with_it(place, capsys, command):
    assert cli.main([command[0], str(place), *command[1:]]) == 2
    sentence = capsys.readouterr().err
    assert "holds samples of sensor units, but no control step" in sentence
    assert sentence.count("\n") == 1


def test_a_file_that_is_cut_off_gives_its_whole_part(place, tmp_path):
    whole = place.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: whole.rindex(b"\x0f\x04\0\0\0\0\0\0\0")])  # before the end of the data
    trace = read_skin(cut)
    assert not trace.complete
    assert [len(unit.samples) for unit in trace.units.values()] == [100, 100]


def test_what_came_is_in_the_file_within_a_second_though_nobody_closes_it(tmp_path):
    recording = SkinRecording(tmp_path / "a.mcap")
    for number in range(1, 6):
        record(recording, number)
    time.sleep(1.0)
    trace = read_skin(tmp_path / "a.mcap")
    recording.close()
    assert (trace.complete, len(trace.units["hand/1"].samples)) == (False, 5)


def test_a_recording_of_control_steps_is_no_recording_of_units(panda_model, paper_skin, tmp_path):
    recorded_run(tmp_path / "run.mcap", controller_of(panda_model, paper_skin), 3)
    with pytest.raises(RecordingError, match="holds no samples of sensor units"):
        read_skin(tmp_path / "run.mcap")
    assert len(open_recording(tmp_path / "run.mcap")) == 3


def test_samples_of_another_version_are_refused(place, tmp_path):
    with pytest.raises(RecordingError, match="another version of pretouch"):
        read_skin(changed(place, tmp_path / "b.mcap", schema=lambda topic, text: text.replace(b"uint8", b"int8")))


NAMES = ("panda_joint1", "panda_joint2")
STAMP, FEW = 100.0 + np.arange(200) / 1000, [heard(number) for number in range(1, 6)]
Q = np.random.default_rng(0).normal(size=(200, 2))


def test_the_usual_tools_read_states_of_joints(tmp_path):
    read_back(tmp_path / "a.mcap", FEW, (STAMP, Q, 0.1 * Q, NAMES))
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


@pytest.mark.parametrize(
    ("q", "qd", "names"),
    [(Q[:, :1], None, NAMES), (Q[1:], None, NAMES), (Q[:, 0], None, NAMES), (Q, Q[:, :1], NAMES), (Q, None, NAMES[:1])],
)
def test_other_shapes_of_joint_states_are_refused_before_anything_is_written(tmp_path, q, qd, names):
    with SkinRecording(tmp_path / "a.mcap") as recording:
        with pytest.raises(RecordingError, match=r"give \(200, [12]\), a row for each instant"):
            recording.joints(STAMP, q, qd, names)
        assert not recording.trouble
