"""What sensor units sent, recorded without a controller."""

import math
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from pretouch import cli
from pretouch.errors import RecordingError
from pretouch.recording.reader import open_recording
from pretouch.recording.skin_reader import read_skin
from pretouch.recording.skin_recording import Diagnosis, Level, SkinRecording
from pretouch.units.traffic import Received
from pretouch.units.wire import Flag, Sample, TouchPart, imu_values
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


def record(recording: SkinRecording, number: int, unit: str = "hand/1") -> None:
    sent = sample(number)
    new = bool(sent.flags & Flag.RANGE_NEW)
    recording.sample(unit, Received(0, arrival(number), stamp(number), 90.0, 1e-4, sent), new)
    at = arrival(number) + np.arange(BATCH) / 416
    recording.imu(unit, at, *imu_values(sent.imu, sent.imu_scale))


@pytest.fixture(scope="module")
def place(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("skin") / "units.mcap"
    with SkinRecording(place) as recording:
        for number in range(1, 101):
            record(recording, number)
            record(recording, number, "wrist")
        recording.health(102.0, [Diagnosis("wrist", Level.WARN, "wrist is cold.", {"temperature_c": "-5.1"})])
    return place


def test_every_field_of_every_sample_comes_back(place):
    trace = read_skin(place)
    assert trace.complete
    assert list(trace.units) == ["hand/1", "wrist"]
    assert (trace.joints, trace.joint_names) == (None, ())
    for unit in trace.units.values():
        assert len(unit.samples) == 100
        for number, kept in enumerate(unit.samples, 1):
            sent = sample(number)
            assert kept.sample == asdict(sent)
            assert kept.arrival == arrival(number)
            assert kept.stamp == stamp(number) or number <= 2
            assert (kept.offset, kept.bound) == (90.0, 1e-4)


def test_ranges_and_imu_come_back_as_arrays(place):
    unit = read_skin(place).units["wrist"]
    fresh = [n for n in range(1, 101) if n % 4]
    assert np.allclose(unit.range.distance, [0.5 + n / 1000 for n in fresh], atol=1e-12)
    assert np.array_equal(unit.range.stamp, [stamp(n) for n in fresh], equal_nan=True)
    assert np.array_equal(unit.range.status, [0 if n % 7 else 4 for n in fresh])
    assert np.allclose(unit.range.sigma, 0.003)
    values = [imu_values(sample(n).imu, 0x21) for n in range(1, 101)]
    at = np.concatenate([arrival(n) + np.arange(BATCH) / 416 for n in range(1, 101)])
    assert np.allclose(unit.imu.stamp, at, atol=1e-8)
    assert np.array_equal(unit.imu.acceleration, np.concatenate([a for a, _ in values]))
    assert np.array_equal(unit.imu.angular_velocity, np.concatenate([w for _, w in values]))


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
            "/diagnostics": ("diagnostic_msgs/msg/DiagnosticArray", 1),
        }
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/diagnostics":
                (status,) = message.status
                assert (status.name, status.level, status.message) == ("wrist", 1, "wrist is cold.")
                assert [(v.key, v.value) for v in status.values] == [("temperature_c", "-5.1")]
            if connection.topic == "/skin/wrist/range":
                assert 0.5 < message.range < 0.61 or math.isinf(message.range)


@pytest.mark.parametrize("command", [("replay", "--no-page"), ("report",)])
def test_other_commands_say_what_can_be_done_with_it(place, capsys, command):
    assert cli.main([command[0], str(place), *command[1:]]) == 2
    said = capsys.readouterr().err
    assert "holds samples of sensor units, but no control step" in said
    assert said.count("\n") == 1


def test_a_file_that_is_cut_off_gives_its_whole_part(place, tmp_path):
    whole = place.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: whole.rindex(b"\x0f\x04\0\0\0\0\0\0\0")])  # before the end of the data
    trace = read_skin(cut)
    assert not trace.complete
    assert trace.samples == 200


def test_what_came_is_in_the_file_within_a_second_though_nobody_closes_it(tmp_path):
    recording = SkinRecording(tmp_path / "a.mcap")
    for number in range(1, 6):
        record(recording, number)
    time.sleep(1.0)
    trace = read_skin(tmp_path / "a.mcap")
    recording.close()
    assert (trace.complete, trace.samples) == (False, 5)


def test_a_recording_of_control_steps_is_no_recording_of_units(controller, tmp_path):
    recorded_run(tmp_path / "run.mcap", controller, 3)
    with pytest.raises(RecordingError, match="holds no samples of sensor units"):
        read_skin(tmp_path / "run.mcap")
    assert len(open_recording(tmp_path / "run.mcap")) == 3


def test_samples_of_another_version_are_refused(place, tmp_path):
    with pytest.raises(RecordingError, match="another version of pretouch"):
        read_skin(changed(place, tmp_path / "b.mcap", schema=lambda topic, text: text.replace(b"uint8", b"int8")))


NAMES = ("panda_joint1", "panda_joint2")
STAMP = 100.0 + np.arange(200) / 1000
Q = np.random.default_rng(0).normal(size=(200, 2))


def recorded(place, *parts):
    """Record units, and states of joints in parts: (stamp, q, qd, names)."""
    with SkinRecording(place) as recording:
        for number in range(1, 6):
            record(recording, number)
        for part in parts:
            recording.joints(*part)
    return read_skin(place)


def test_the_usual_tools_read_states_of_joints(tmp_path):
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


def test_states_of_joints_are_sorted_and_what_is_no_number_or_came_twice_is_left_out(tmp_path):
    q = Q.copy()
    q[5] = np.nan
    trace = recorded(
        tmp_path / "a.mcap", (STAMP[100:], q[100:], None, NAMES), (STAMP[:101], q[:101] + 1.0, None, NAMES)
    )
    np.testing.assert_array_equal(trace.joints.q, np.delete(np.vstack([q[:101] + 1.0, q[101:]]), 5, axis=0))
    np.testing.assert_allclose(trace.joints.stamp, np.delete(STAMP, 5), atol=1e-9)


def test_joints_of_another_arm_in_the_same_file_are_refused(tmp_path):
    with pytest.raises(RecordingError, match="states of the joints a, b and of panda_joint1, panda_joint2"):
        recorded(tmp_path / "a.mcap", (STAMP, Q, None, NAMES), (STAMP, Q, None, ("a", "b")))


@pytest.mark.parametrize(
    ("q", "qd", "names"),
    [(Q[:, :1], None, NAMES), (Q[1:], None, NAMES), (Q[:, 0], None, NAMES), (Q, Q[:, :1], NAMES), (Q, None, NAMES[:1])],
)
def test_other_shapes_of_joint_states_are_refused_before_anything_is_written(tmp_path, q, qd, names):
    with SkinRecording(tmp_path / "a.mcap") as recording:
        with pytest.raises(RecordingError, match=r"give \(200, [12]\), a row for each instant"):
            recording.joints(STAMP, q, qd, names)
        assert not recording.trouble
