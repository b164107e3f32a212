"""Trouble that people meet with their recordings: it is read, or refused in one sentence, and nothing is lost."""

import json
import sqlite3
from datetime import UTC, datetime, timedelta

import numpy as np
import pyarrow as pa
import pytest
from mcap.writer import Writer
from pyarrow import parquet
from rosbags.rosbag2 import StoragePlugin

from pretouch.cli.detect import Detect
from pretouch.cli.detect_words import sentence
from pretouch.errors import RecordingError
from pretouch.imported_data.log import Choice, unwrapped
from pretouch.imported_data.reading import open_log, read_joints
from tests.imported_data.files import JOINTS, PANDA, START, STORE, STORE1, joints, write_bag, write_bag1, write_csv

RATE, COUNT = 100, 300
TIME = np.arange(COUNT) / RATE
POSTURE = np.array([0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.7])
Q = POSTURE + 0.4 * np.sin(np.outer(TIME, 1 + 0.1 * np.arange(7)))
TAU = 5.0 + np.random.default_rng(1).standard_normal(Q.shape)
NS = np.round(TIME * 1e9).astype(np.int64)


def states(stamps=START + NS, logged=None, q=Q, tau=TAU, names=PANDA, topic="/joint_states"):
    rows = zip(stamps, stamps if logged is None else logged, q, tau, strict=True)
    return [(topic, t, joints(int(stamp), row, names, effort=e)) for stamp, t, row, e in rows]


def table(time=TIME, name="time_s", q=Q):
    return {name: time} | {f"q{j + 1}_rad": q[:, j] for j in range(7)}


def told(log):
    """The codes of notes on rows, their counts and the first row."""
    return [(n.code, n.values["count"], n.values["first"]) for n in log.notes if "first" in n.values]


def mcap(file, *channels):
    """Write messages of other encodings: (topic, encoding, type, encoding and text of its definition, bytes)."""
    with file.open("wb") as stream:
        writer = Writer(stream, chunk_size=4096)
        writer.start()
        for topic, encoding, kind, form, definition, messages in channels:
            schema = writer.register_schema(kind, form, definition)
            channel = writer.register_channel(topic, encoding, schema)
            for i, data in enumerate(messages):
                writer.add_message(channel, START + i * 10**7, data, START + i * 10**7)
        writer.finish()
    return file


DEFINED = STORE.generate_msgdef(JOINTS, ros_version=2)[0]


def cdr(messages, definition=DEFINED):
    data = [bytes(STORE.serialize_cdr(message, JOINTS)) for *_, message in messages]
    return "/joint_states", "cdr", JOINTS, "ros2msg", definition.encode(), data


JSON = "/joints", "json", "my.JointState", "jsonschema", b"{}", [b"{}"]
STATE = "/state", "cdr", "franka_msgs/msg/FrankaRobotState", "ros2msg", b"", [bytes(20)]


@pytest.mark.parametrize(
    ("channel", "words"),
    [
        (JSON, r"the messages on /joints \(my\.JointState\) are in JSON"),
        (("/j", "protobuf", "foxglove.Joints", "protobuf", b"", [b"\x08"]), r"\(foxglove\.Joints\) are in Protobuf"),
        (("/j", "", "", "", b"", [b"\x08"]), "are in an encoding without a name"),
        (STATE, "does not hold the definition of franka_msgs/msg/FrankaRobotState, on /state: record"),
        ((*STATE[:4], b"no definition!", [b""]), "does not hold the definition of franka_msgs/.* on /state \\("),
        ((*cdr([], "")[:5], [bytes(9)]), "no sensor_msgs/msg/JointState, whose definition in the file is empty"),
    ],
)
def test_what_a_file_holds_is_named_before_it_is_called_broken(tmp_path, panda_model, channel, words):
    with pytest.raises(RecordingError, match=words) as caught:
        read_joints(mcap(tmp_path / "a.mcap", channel), panda_model)
    assert "complete" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("channels", "codes"),
    [((JSON, cdr(states())), []), ((cdr(states(), ""),), []), ((STATE, cdr(states())), ["fault"])],
)
def test_topics_that_can_be_read_are_read_beside_others(tmp_path, panda_model, channels, codes):
    trace, log = read_joints(mcap(tmp_path / "a.mcap", *channels), panda_model)
    np.testing.assert_array_equal(trace.q, Q)
    assert [note.code for note in log.notes] == codes


def test_a_folder_is_read_by_its_files_where_its_description_does_not_help(tmp_path, panda_model):
    for name, plugin in (("old", StoragePlugin.SQLITE3), ("new", StoragePlugin.MCAP)):
        folder = write_bag(tmp_path / name, states(), plugin)
        text = (folder / "metadata.yaml").read_text()
        (folder / "metadata.yaml").write_text(text.replace("sqlite3", "''").replace("mcap\n", "''\n"))
        np.testing.assert_array_equal(read_joints(folder, panda_model)[0].q, Q)
        (folder / "metadata.yaml").unlink()
        np.testing.assert_array_equal(read_joints(folder, panda_model)[0].q, Q)


def test_a_database_of_an_older_ros_has_no_definitions_and_is_read_for_the_usual_types(tmp_path, panda_model):
    folder = write_bag(tmp_path / "old", states(), StoragePlugin.SQLITE3)
    (file,) = folder.glob("*.db3")
    with sqlite3.connect(file) as base:
        base.execute("DROP TABLE message_definitions")
    base.close()
    np.testing.assert_array_equal(read_joints(folder, panda_model)[0].q, Q)
    file.write_bytes(file.read_bytes()[:-4096])
    with pytest.raises(RecordingError, match=r"cannot be read \(it has \d+ of \d+ bytes\): give a complete file"):
        read_joints(folder, panda_model)


def test_of_a_file_that_was_cut_what_is_whole_is_read_and_that_is_said(tmp_path, panda_model):
    file = mcap(tmp_path / "a.mcap", cdr(states()))
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    trace, log = read_joints(file, panda_model)
    assert 100 < len(trace.q) < 200
    np.testing.assert_array_equal(trace.q, Q[: len(trace.q)])
    assert [note.code for note in log.notes] == ["cut"]


@pytest.mark.parametrize("lists", [[[1.0] * 7, [1.0] * 8], [[1.0] * 7, [1.0] * 7, [1.0] * 6]])
def test_lists_of_other_lengths_in_a_table_are_refused_with_row_and_lengths(tmp_path, panda_model, lists):
    columns = {"time_s": np.arange(len(lists)) / 100, "q": lists}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    words = f"row {len(lists)}: q has {len(lists[-1])} values, and 7 in row 1"
    with pytest.raises(RecordingError, match=words):
        read_joints(tmp_path / "a.parquet", panda_model)


@pytest.mark.parametrize("part", ["position", "velocity", "effort"])
def test_names_and_numbers_of_a_message_that_do_not_agree_are_refused_with_both_counts(tmp_path, panda_model, part):
    messages = states()
    for *_, message in messages[5:]:
        message.velocity = message.position.copy()
        setattr(message, part, getattr(message, part)[:-1])
    words = r"Message 6 on /joint_states of .* names 7 joints and has 6 \w+: record as many"
    with pytest.raises(RecordingError, match=words):
        read_joints(write_bag(tmp_path / "bag", messages), panda_model)


WRAPS = [
    ("time_us", 1e6, 2.0**32 / 1e6),
    ("time_ms", 1e3, 65.536),
    ("time_s", 1.0, 60.0),
    ("time_s", 1.0, 86_400.0),
    ("time_ns", 1e9, 2.0**32 / 1e9),
    ("time_s", 1.0, 1.0),
    ("time_us", 1e6, 2.0**24 / 1e6),
]


@pytest.mark.parametrize(("name", "per_s", "period"), WRAPS)
def test_a_clock_that_is_too_small_goes_on_in_tables_and_bags(tmp_path, panda_model, name, per_s, period):
    clock = (period - 0.805 + TIME) % period
    wraps = round((TIME[-1] + period - 0.805) // period)
    file = write_csv(tmp_path / "a.csv", table(np.round(clock * 1e9) / 1e9 * per_s, name))
    bag = write_bag(tmp_path / "bag", states(np.round(clock * 1e9).astype(np.int64), START + NS))
    for place, first in ((file, "line 83"), (bag, "message 82 on /joint_states")):
        trace, log = read_joints(place, panda_model)
        np.testing.assert_allclose(trace.stamp, period - 0.805 + TIME, atol=1e-6)
        np.testing.assert_array_equal(trace.q, Q)
        assert told(log) == [("wraps", wraps, first)]
        assert f"first at {first}" in sentence(log.notes[-1])


@pytest.mark.parametrize(
    "time",
    [
        np.where(TIME < 2.0, TIME, TIME - 0.75),  # a clock that was set
        np.where(TIME < 2.0, 25.0 + TIME, TIME - 1.0),  # a restart
        np.where(TIME < 1.0, 59.0 + TIME, TIME),  # another recording, which began a second earlier
        np.concatenate([np.linspace(0.0, 60.0, 200, endpoint=False), np.linspace(0.0, 30.0, 100)]),  # two of a minute
    ],
)
def test_a_time_that_begins_anew_is_refused_with_its_row_in_every_kind_of_file(tmp_path, panda_model, time):
    first = int(np.argmax(np.diff(time) < 0)) + 1
    stamps, words = START + np.round(time * 1e9).astype(np.int64), r" on /joint_states: the time goes back by"
    store1 = [(topic, t, STORE1.types[JOINTS](*_ros1(m))) for topic, t, m in states(stamps)]
    bags = [write_bag(tmp_path / p.name, states(stamps), p) for p in (StoragePlugin.MCAP, StoragePlugin.SQLITE3)]
    for bag in (*bags, write_bag1(tmp_path / "a.bag", store1)):
        with pytest.raises(RecordingError, match=rf"message {first + 1}{words}"):
            read_joints(bag, panda_model)
    with pytest.raises(RecordingError, match=rf"line {first + 2}: the time goes back by"):
        read_joints(write_csv(tmp_path / "a.csv", table(time)), panda_model)


def _ros1(message):
    stamp = STORE1.types["builtin_interfaces/msg/Time"](message.header.stamp.sec, message.header.stamp.nanosec)
    header = STORE1.types["std_msgs/msg/Header"](0, stamp, "")
    return header, message.name, message.position, message.velocity, message.effort


def test_a_counter_with_a_sign_goes_on_and_instants_that_go_on_are_left_as_they_are():
    micro = 2**31 - 500_000 + np.arange(0, 1_000_000, 10_000)
    time, period = unwrapped(1000 * np.where(micro < 2**31, micro, micro - 2**32))
    assert (period, time.tolist()) == (2**32 / 1e6, (1000 * micro).tolist())
    for time in (START + NS, NS, np.array([], np.int64), np.array([5])):
        assert unwrapped(time)[0] is time


BACK = START + NS - np.where(np.arange(COUNT) < 120, 0, 10**9)
BURSTS = START + 10**9 * np.ceil(TIME).astype(np.int64)


@pytest.mark.parametrize(
    ("header", "logged", "choice", "time", "codes"),
    [
        (BACK, START + NS, "auto", NS, ["headers_back"]),
        (np.full(COUNT, START), START + NS, "auto", NS, ["headers_back"]),
        (START + NS, BACK, "auto", NS, []),
        (START + NS, BURSTS, "auto", NS, []),
        (START + NS, START + 2 * NS, "auto", NS, ["pace"]),
        (START + NS, START + 2 * NS, "recording", 2 * NS, []),
        (START + NS * (np.arange(COUNT) > 4), START + 2 * NS, "auto", 2 * NS, ["no_stamps"]),
        (START + NS // 2, START + NS, "headers", NS // 2, []),
    ],
)
def test_of_two_clocks_the_one_that_goes_on_is_used_and_that_is_said(
    tmp_path, panda_model, header, logged, choice, time, codes
):
    if "no_stamps" in codes:
        header = np.where(header > START, header, 0)
    bag = write_bag(tmp_path / "bag", states(header, logged))
    log = open_log(bag, Choice(arm=panda_model, stamps=choice)).positions().in_order("q")
    np.testing.assert_array_equal(log.time, START + time)
    np.testing.assert_array_equal(log.arrays["q"], Q)
    assert [note.code for note in log.notes] == codes


def test_a_clock_that_stands_still_while_the_arm_moves_is_refused(tmp_path, panda_model):
    time = np.where((TIME > 1.0) & (TIME < 1.8), 1.0, TIME)
    with pytest.raises(RecordingError, match="line 102: the time stands still for 80 samples"):
        read_joints(write_csv(tmp_path / "a.csv", table(time)), panda_model)


def between(values, what):
    """Values (N, n) of which some rows in the middle are others."""
    changed = values.copy()
    changed[100:180] = what
    return changed


REST = np.concatenate([Q[:100], np.repeat(Q[99:100], 80, axis=0), Q[100:220]])
TO_ZERO = np.concatenate([np.linspace(POSTURE, 0.0, 150), np.zeros((100, 7)), np.linspace(0.0, POSTURE, 50)])


@pytest.mark.parametrize(
    ("q", "tau", "notes"),
    [
        (between(Q, 0.0), TAU, ("zeros", 80, 100)),
        (between(Q, Q[99]), between(TAU, TAU[99]), ("repeats", 80, 100)),
        (Q, between(TAU, 0.0), ("zeros", 80, 100)),
        (Q, between(TAU, TAU[99]), ("repeats", 80, 100)),
        (np.concatenate([np.zeros((80, 7)), Q[80:]]), TAU, ("zeros", 80, 0)),
        (REST, TAU, None),
        (TO_ZERO, TAU, None),
    ],
    ids=["zeros", "frozen", "no torques", "frozen torques", "zeros first", "at rest", "to the zero posture"],
)
def test_values_that_are_none_are_left_out_and_an_arm_at_rest_is_not(tmp_path, panda_model, q, tau, notes):
    columns = table(q=q) | {f"tau{j + 1}_Nm": tau[:, j] for j in range(7)}
    bag = write_bag(tmp_path / "bag", states(q=q, tau=tau)), 1, "message {} on /joint_states"
    for place, first, row in ((write_csv(tmp_path / "a.csv", columns), 2, "line {}"), bag):
        log = open_log(place, Choice(arm=panda_model)).torques().in_order("q", "tau")
        assert len(log) == COUNT - (80 if notes else 0)
        assert told(log) == ([(*notes[:2], row.format(notes[2] + first))] if notes else [])
        assert not notes or "80 rows" in sentence(log.notes[-1])


def test_a_force_that_does_not_change_is_no_estimate_and_the_output_says_so(tmp_path, capsys):
    force = between(np.random.default_rng(2).standard_normal((1000, 3)), 1.0)
    columns = {"time_s": np.arange(1000) / RATE} | {f"force_{a}_N": force[:, i] for i, a in enumerate("xyz")}
    Detect(write_csv(tmp_path / "a.csv", columns), json=tmp_path / "a.json").run()
    numbers = json.loads((tmp_path / "a.json").read_text())
    assert numbers["data"][0] == {"code": "repeats", "values": {"count": 79, "first": "line 103"}}
    assert numbers["notes"][0].startswith("79 rows repeat the one before")
    assert numbers["notes"][0] in capsys.readouterr().out


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("time_s", *PANDA), r"has times and joint positions, but no torques \(tau_ext1_Nm"),
        (("time_s", *(f"tau{j}_Nm" for j in range(1, 8))), r"has times and torques, but no joint positions \(q1_rad"),
        (tuple(f"q_{j}" for j in range(7)), r"has joint positions, but no times \(time_s\) and no torques \(tau_ext1"),
        (("time_s", "dq1_rad_s"), "has times and joint velocities, but no joint positions .* and no torques"),
        (("a", "b"), r"has columns, but no times .* and no force \(force_x_N, .*; of joints, q1_rad"),
    ],
)
def test_of_a_log_of_joints_all_that_it_lacks_is_said_at_once(tmp_path, names, words):
    names = [f"{name}_rad" if name in PANDA else name for name in names]
    file = write_csv(tmp_path / "a.csv", dict.fromkeys(names, TIME))
    with pytest.raises(RecordingError, match=words):
        Detect(file).run()


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("effort", "/joint_states of .* has joint positions but no torques"),
        ("position", "has joint torques, on /joint_states, but no joint positions"),
    ],
)
def test_of_a_bag_of_joints_what_it_lacks_is_said(tmp_path, part, words):
    messages = states()
    for *_, message in messages:
        setattr(message, part, np.zeros(0))
    with pytest.raises(RecordingError, match=words):
        Detect(write_bag(tmp_path / "bag", messages)).run()


def test_efforts_of_zero_do_not_matter_where_only_positions_are_needed(tmp_path, panda_model):
    trace, log = read_joints(write_bag(tmp_path / "bag", states(tau=0 * TAU)), panda_model)
    np.testing.assert_array_equal(trace.q, Q)
    assert log.notes == ()


@pytest.mark.parametrize("zone", [None, timedelta(hours=2)])
def test_dates_are_times(tmp_path, panda_model, zone):
    first = datetime(2026, 10, 25, 2, 59, 59, tzinfo=UTC)
    shown = [first + timedelta(seconds=t) + (zone or timedelta()) for t in TIME.tolist()]
    ending = "+02:00" if zone else ""
    lines = (file := write_csv(tmp_path / "a.csv", table())).read_text().splitlines()
    rows = [
        f"{t:%Y-%m-%dT%H:%M:%S.%f}{ending},{line.split(',', 1)[1]}" for t, line in zip(shown, lines[1:], strict=True)
    ]
    file.write_text("\n".join([lines[0], *rows]))
    trace, log = read_joints(file, panda_model)
    np.testing.assert_allclose(trace.stamp, first.timestamp() + TIME, atol=1e-6)
    assert [note.code for note in log.notes] == ["dates"]
