"""Runs that are recorded: what stands in the file, for us and for everybody else's readers."""

import re
import signal
from collections import Counter
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from pretouch.errors import RecordingError
from pretouch.recording.reader import open_recording
from pretouch.recording.ros import decoded, packed_data
from pretouch.recording.viewer_topics import nanoseconds, topic_name
from pretouch.recording.writer import Recording
from tests.fuzz.invariants import same
from tests.recording.runs import Run, record


@pytest.fixture(scope="module")
def made(controller, tmp_path_factory) -> tuple[Path, Run]:
    place = tmp_path_factory.mktemp("made") / "run.mcap"
    return place, record(Run(controller), place, 330, about={"seed": 0})


def test_all_cycles_come_back_to_the_bit(made):
    place, run = made
    recorded = open_recording(place)
    assert recorded.complete
    assert recorded.sentence == ""
    assert recorded.runs[0].about == {"seed": 0}
    assert len(recorded) == len(run.cycles)
    for kept, cycle in zip(recorded, run.cycles, strict=True):
        assert same(kept.step, cycle.step)
        assert same(kept.inputs, cycle.inputs)
        assert kept.snapshot is None or same(kept.snapshot, cycle.before)
        assert kept.truth is None
    assert np.array_equal(recorded.stamps(), [cycle.step.stamp for cycle in run.cycles])


def test_snapshots_come_with_the_first_cycle_and_every_three_seconds(made):
    snapshots = [(kept.step.stamp, kept.anew) for kept in open_recording(made[0]) if kept.snapshot is not None]
    assert snapshots == [(0.0, True), (pytest.approx(3.0, abs=0.025), False)]


def test_the_official_reader_opens_it_with_all_checksums(made):
    place, run = made
    with place.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        counts, times = Counter[str](), []
        for schema, channel, message in reader.iter_messages():
            decoded(schema.name, message.data)
            counts[channel.topic] += 1
            times.append(message.log_time)
        summary = reader.get_summary()
    assert times == sorted(times)
    assert counts["/pretouch/step"] == counts["/pretouch/inputs"] == counts["/joint_states"] == len(run.cycles)
    assert counts["/wrench"] == len(run.cycles)
    assert counts["/pretouch/run"] == counts["/tf_static"] == counts["/markers/scene"] == 1
    assert counts["/skin/hand_left/range"] == len(run.cycles) // 2
    assert 0 < counts["/tf"] == counts["/markers"] <= 30 * 3.3
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == counts.total()


def test_rosbags_opens_it_and_reads_our_messages_by_their_embedded_definition(made):
    place, run = made
    with AnyReader([place]) as reader:
        connections = [c for c in reader.connections if c.topic == "/pretouch/step"]
        for cycle, (connection, time, data) in zip(run.cycles, reader.messages(connections), strict=True):
            message = reader.deserialize(data, connection.msgtype)
            assert time == round(cycle.step.stamp * 1e9)
            assert message.reason == cycle.step.reason
            assert message.thresholds.upper.tobytes() == cycle.step.thresholds.upper.tobytes()
            assert message.range_distance.tobytes() == cycle.step.range_distance.tobytes()
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)


def spoiled(inputs):
    """The same inputs with numbers that are none in them."""
    robot = replace(inputs.robot, wrench=np.array([np.nan, np.inf, -np.inf, -0.0, 5e-324, 1e308]))
    readings = replace(inputs.readings, distance=np.array([np.nan, np.inf, -np.inf, 1e308, -0.0, 0.3, 4.0]))
    return replace(inputs, robot=robot, readings=readings)


def test_any_msgpack_library_reads_the_inputs_by_name(made):
    place, run = made
    with place.open("rb") as file:
        data = [m.data for _, c, m in make_reader(file).iter_messages() if c.topic == "/pretouch/inputs"]
    for message, cycle in zip(data, run.cycles, strict=True):
        inputs = msgspec.msgpack.decode(packed_data(message))["inputs"]
        assert np.frombuffer(inputs["robot"]["q"]).tolist() == cycle.inputs.robot.q.tolist()


def test_nan_and_infinity_come_back_and_the_time_in_the_file_is_clamped_where_ros_has_none(controller, tmp_path):
    stamps, place = [-5.0, 1.0, 1e11, float("nan"), -1e11, 2.0], tmp_path / "a.mcap"
    run = record(Run(controller), place, 6, lambda i, inputs: replace(spoiled(inputs), stamp=stamps[i]))
    with AnyReader([place]) as reader:
        read = [(c, time, data) for c, time, data in reader.messages()]
        ranges = [reader.deserialize(data, c.msgtype) for c, _, data in read if c.topic.endswith("/range")]
    assert all(0 <= time < 2**63 for _, time, _ in read)
    assert any(np.isnan(r.range) for r in ranges)
    recorded = open_recording(place)
    assert [kept.step.stamp for kept in recorded] == [cycle.step.stamp for cycle in run.cycles]
    assert all(same(kept.inputs, cycle.inputs) for kept, cycle in zip(recorded, run.cycles, strict=True))


def test_a_snapshot_follows_inputs_that_fit_no_message_and_time_that_went_back(controller, tmp_path):
    def changed(i, inputs):
        return replace(inputs, stamp=inputs.stamp - 0.02 * (i == 8), robot=None if i == 4 else inputs.robot)

    record(Run(controller), tmp_path / "a.mcap", 10, changed)
    recorded = open_recording(tmp_path / "a.mcap")
    assert [i for i, kept in enumerate(recorded) if kept.snapshot] == [0, 5, 8]
    assert [i for i, kept in enumerate(recorded) if kept.inputs is None] == [4]
    assert "robot=None" in recorded[4].unreadable
    assert recorded[5].unreadable == ""


def test_a_state_that_was_begun_anew_is_noticed(controller, tmp_path):
    run, other = Run(controller), Run(controller, seed=5, time=1.0)
    with Recording(tmp_path / "a.mcap", controller) as recording:
        for each in (run, run, other, other):
            recording.record(each.turn())
    assert [i for i, kept in enumerate(open_recording(tmp_path / "a.mcap")) if kept.anew] == [0, 2]


def test_boxes_of_the_scene_and_the_arm_are_drawn(controller, tmp_path):
    about = {"scene": {"boxes": [{"name": "board", "center": [0.5, 0.3, 0.2], "half_size": (0.1, 0.02, 0.12)}]}}
    run = record(Run(controller), tmp_path / "a.mcap", 20, about=about)
    with AnyReader([tmp_path / "a.mcap"]) as reader:
        read = [(c.topic, reader.deserialize(d, c.msgtype)) for c, _, d in reader.messages() if "/markers" in c.topic]
        links = [reader.deserialize(d, c.msgtype) for c, _, d in reader.messages() if c.topic == "/tf"]
    (standing,) = (m for topic, m in read if topic == "/markers/scene")
    (box,) = (m for m in standing.markers if m.ns == "box")
    assert (box.scale.x, box.pose.position.y) == (0.2, 0.3)
    assert sum(m.ns == "arm" for m in standing.markers) == 3 * len(controller.model.capsules.radius)
    first = links[0].transforms[-1]
    hand = controller.model.kinematics(run.cycles[0].step.q).position[-1]
    assert [first.transform.translation.x, first.transform.translation.z] == pytest.approx([hand[0], hand[2]])
    assert first.child_frame_id == controller.model.links[-1]
    assert len(links[0].transforms) == len(controller.model.links) - 1


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"scene": {"boxes": [{"center": [0, 0, 0]}]}}, "half_size"),
        ({"scene": {"boxes": [{"center": [0, 0], "half_size": [1, 1, 1]}]}}, "half_size"),
        ({"what": {1, 2}}, "JSON"),
    ],
)  # fmt: skip
def test_boxes_that_cannot_be_drawn_and_facts_that_json_cannot_hold_are_refused(controller, tmp_path, facts, said):
    with pytest.raises(RecordingError, match=said):
        Recording(tmp_path / "a.mcap", controller, facts)
    assert not (tmp_path / "a.mcap").exists()


def test_what_is_there_is_never_written_over(controller, tmp_path):
    (tmp_path / "a.mcap").write_text("dear")
    with pytest.raises(RecordingError, match="another name"):
        Recording(tmp_path / "a.mcap", controller)
    assert (tmp_path / "a.mcap").read_text() == "dear"


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("", "another name"),
        ("nowhere/a.mcap", r"folder .*nowhere.* does not exist"),
        ("file/a.mcap", "does not exist"),
        (f"{'a' * 300}.mcap", r"aaa\.mcap cannot be written: File name too long: give another"),
        ("/proc/a.mcap", r"/proc/a\.mcap cannot be written"),
    ],
)
def test_a_place_that_cannot_be_written_is_named_with_the_reason(controller, tmp_path, place, said):
    (tmp_path / "file").touch()
    with pytest.raises(RecordingError, match=said):
        Recording(tmp_path / place, controller)


def test_closing_twice_says_the_same_and_later_cycles_are_left_out(controller, tmp_path):
    run = Run(controller)
    recording = Recording(tmp_path / "a.mcap", controller)
    recording.record(run.turn())
    recording.record(run.turn())
    closed = recording.close()
    recording.record(run.turn())
    assert recording.close() == closed
    assert "2 control steps, 0.0 s, in" in closed
    assert len(open_recording(tmp_path / "a.mcap")) == 2


def test_a_recording_without_a_step_says_so(controller, tmp_path):
    with Recording(tmp_path / "a.mcap", controller):
        pass
    with pytest.raises(RecordingError, match="no control step"):
        open_recording(tmp_path / "a.mcap")
    with (tmp_path / "a.mcap").open("rb") as file:
        assert not list(make_reader(file).iter_messages())


@pytest.mark.parametrize(
    ("number", "error"), [(signal.SIGTERM, SystemExit), (signal.SIGHUP, SystemExit), (signal.SIGINT, KeyboardInterrupt)]
)
def test_a_signal_leaves_a_whole_file_and_is_handled_as_before_once_it_is_closed(controller, tmp_path, number, error):
    before, run = signal.getsignal(number), Run(controller)
    recording = Recording(tmp_path / "a.mcap", controller)
    recording.record(run.turn())
    with pytest.raises(error), recording:
        signal.raise_signal(number)
    assert signal.getsignal(number) == before
    recorded = open_recording(tmp_path / "a.mcap")
    assert recorded.complete
    assert len(recorded) == 1


@given(st.floats(), st.integers(0, 10**18))
def test_any_stamp_is_a_time_that_ros_and_mcap_can_hold(stamp, instead):
    time = nanoseconds(stamp, instead)
    assert 0 <= time // 10**9 < 2**31
    if 0 <= stamp < 1e6:
        assert abs(time - stamp * 1e9) <= 1
    if np.isnan(stamp):
        assert time == instead


@given(st.text(min_size=1))
def test_any_unit_has_a_topic_that_ros_allows(name):
    assert re.fullmatch("[A-Za-z_][A-Za-z0-9_]*", topic_name(name))
    assert topic_name("hand_left") == "hand_left"
