"""What sensor units sent, recorded without a controller."""

import math
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from pretouch import cli
from pretouch.errors import RecordingError
from pretouch.hardware.traffic import Received
from pretouch.hardware.wire import Flag, Sample, TouchPart, imu_values
from pretouch.recording.reader import open_recording
from pretouch.recording.skin_reader import read_skin
from pretouch.recording.skin_recording import Diagnosis, Level, SkinRecording

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


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "is empty"), (b"time", "is not an MCAP file"), (b"\x89MCAP0\r\n", "holds no samples of sensor units")],
)
def test_a_file_of_something_else_is_refused(tmp_path, content, words):
    other = tmp_path / "other.mcap"
    other.write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        read_skin(other)
    with pytest.raises(RecordingError, match="it does not exist"):
        read_skin(tmp_path / "none.mcap")


def test_a_recording_of_control_steps_is_no_recording_of_units(panda_model, paper_skin, tmp_path):
    from tests.recording.runs import controller_of, recorded_run

    recorded_run(tmp_path / "run.mcap", controller_of(panda_model, paper_skin), 3)
    with pytest.raises(RecordingError, match="holds no samples of sensor units"):
        read_skin(tmp_path / "run.mcap")
    assert len(open_recording(tmp_path / "run.mcap")) == 3


def test_samples_of_another_version_are_refused(place, tmp_path):
    with place.open("rb") as old, (tmp_path / "other.mcap").open("wb") as new:
        writer = Writer(new)
        writer.start("ros2", "pretouch 9")
        for schema, channel, message in make_reader(old).iter_messages(topics=["/skin/wrist/sample"]):
            number = writer.register_schema(schema.name, schema.encoding, schema.data.replace(b"uint8", b"int8"))
            topic = writer.register_channel(channel.topic, "cdr", number)
            writer.add_message(topic, message.log_time, message.data, message.publish_time)
        writer.finish()
    with pytest.raises(RecordingError, match="another version of pretouch"):
        read_skin(tmp_path / "other.mcap")


def test_nothing_is_written_over(place):
    with pytest.raises(RecordingError, match="exists already"):
        SkinRecording(place)


_ENDLESS = """
import sys, time
from pathlib import Path
from tests.recording.test_skin_recording import record
from pretouch.recording.skin_recording import SkinRecording
recording = SkinRecording(Path(sys.argv[1]))
began, number = time.monotonic(), 0
while True:
    number += 1
    record(recording, number)
    print(number, flush=True)
    time.sleep(max(0.0, began + 0.02 * number - time.monotonic()))
"""


@pytest.mark.slow
def test_a_killed_process_loses_at_most_the_last_second(tmp_path):
    place = tmp_path / "killed.mcap"
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", _ENDLESS, str(place)]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root, env=environment) as process:
        assert process.stdout
        until, last = None, 0
        for line in process.stdout:
            last, until = int(line), until or time.monotonic() + 2.5
            if time.monotonic() > until:
                process.kill()  # what is left in the pipe is read to its end
    trace = read_skin(place)
    assert not trace.complete
    assert last - trace.samples <= 50


def test_a_full_disk_is_said_in_a_sentence(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    recording = SkinRecording(tmp_path / "full.mcap")
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, before[1]))
        for number in range(1, 4000):
            record(recording, number)
        said = recording.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert said == recording.trouble
    assert "ended early" in said
    assert "free some space, then record again" in said
    assert 0 < read_skin(tmp_path / "full.mcap").samples < 4000
