"""Tables: names, units, separators, gaps in cells, and what is wrong with them in one sentence."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from pretouch.errors import RecordingError
from pretouch.imported_data.log import Choice
from pretouch.imported_data.reading import open_log, read_force, read_joints
from tests.imported_data.files import force_columns, write_csv

FORCE = np.random.default_rng(0).normal(size=(50, 3))
Q = np.array([0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.7])
MOVING = Q + 0.01 * np.arange(50)[:, None] * np.array([1, 2, -1, 3, 1, -2, 1])
NAMED = tuple(f"q{i}_rad" for i in range(1, 8))
GOOD = "time_s,force_x_N,force_y_N,force_z_N\n0.00,1,2,3\n0.01,4,5,6\n"


def written(tmp_path, text, name="a.csv"):
    file = tmp_path / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


def forces_of(file):
    return open_log(file, Choice()).force(posture=False)


def table(names=NAMED, q=MOVING, begin=5.0):
    return {"time_s": begin + np.arange(len(q)) / 100} | {name: q[:, i] for i, name in enumerate(names)}


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_separators_and_line_endings_make_no_difference(tmp_path, separator, ending):
    log = forces_of(write_csv(tmp_path / "a.csv", force_columns(FORCE), separator, ending))
    np.testing.assert_array_equal(log.arrays["force"], FORCE)
    np.testing.assert_array_equal(log.time, np.arange(50) * 10_000_000)
    assert log.notes == ()


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("TIME_S,Force_X_n,FORCE_Y_N,force_z_N", 1.0),
        ("# time_s, force_x_N, force_y_N, force_z_N", 1.0),
        ('"time_s","force_x_N","force_y_N","force_z_N"', 1.0),
        ("\ufefftime_s,force_x_N,force_y_N,force_z_N", 1.0),
        ("time_s,force_x_kN,force_y_kN,force_z_kN", 1000.0),
        ("time_s,force_x_N,force_y_N,force_z_N,", 1.0),
        ("\n\ntime_s,force_x_N,force_y_N,force_z_N", 1.0),
    ],
)
def test_headers_are_read_as_people_write_them(tmp_path, header, factor):
    log = forces_of(written(tmp_path, f"{header}\n0.0,1,2,3\n0.01,4,5,6,\n\n"))
    np.testing.assert_array_equal(log.arrays["force"], factor * np.array([[1, 2, 3], [4, 5, 6]]))


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_units_of_time_are_converted(tmp_path, unit, per_second):
    columns = force_columns(FORCE)
    seconds = columns.pop("time_s") + 1.7e9
    log = forces_of(write_csv(tmp_path / "a.csv", {f"time_{unit}": seconds * per_second} | columns))
    np.testing.assert_allclose(log.time, 1.7e18 + np.arange(50) * 1e7, rtol=0, atol=1e3)


def test_columns_may_stand_in_any_order_among_others_and_in_degrees(tmp_path, panda_model):
    columns = table()
    shuffled = {name.replace("rad", "deg"): np.degrees(columns[name]) for name in reversed(NAMED)}
    columns = {"dq1_rad": np.zeros(50), "torso": np.zeros(50)} | shuffled | {"time_ms": 1e3 * columns["time_s"]}
    trace, log = read_joints(write_csv(tmp_path / "a.csv", columns, separator=";"), panda_model)
    np.testing.assert_allclose(trace.q, MOVING, atol=1e-12)
    assert [(note.code, note.values["names"]) for note in log.notes] == [("unused", "'dq1_rad', 'torso'")]


def test_empty_cells_are_no_estimate_and_rows_without_time_are_left_out(tmp_path):
    text = GOOD + "0.02,,8,9\n,1,1,1\n0.03,nan,1,1\n0.04,1,2,inf\n0.05,7,8,9\n"
    recording = read_force(open_log(written(tmp_path, text), Choice()), Choice())
    np.testing.assert_array_equal(np.isnan(recording.force[:, 0]), [False, False, True, True, True, False])
    assert [(note.code, note.values["count"]) for note in recording.notes] == [("no_time", 1), ("no_estimate", 3)]


def test_what_is_no_number_or_comes_twice_is_left_out_and_counted(tmp_path, panda_model):
    columns = table()
    columns["q3_rad"] = np.where(np.arange(50) == 7, np.nan, columns["q3_rad"])
    columns["time_s"][[20, 21]] = columns["time_s"][[21, 20]]
    columns["time_s"][31] = columns["time_s"][30]
    columns["time_s"][40] = np.nan
    trace, log = read_joints(write_csv(tmp_path / "a.csv", columns), panda_model)
    np.testing.assert_array_equal(trace.q, np.delete(MOVING[[*range(20), 21, 20, *range(22, 50)]], [7, 30, 40], axis=0))
    assert [(note.code, note.values["count"]) for note in log.notes] == [
        ("no_time", 1), ("not_finite", 1), ("sorted", 1), ("repeated", 1),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("\n\n \n", "is empty"),
        ("1,2,3\n4,5,6\n", "has no header"),
        ("time_s,force_x_N,force_y_N,force_z_N\n", "has no row with a time"),
        (GOOD[:46], "has 1 samples, and 1 of them is usable"),
        (GOOD.replace("time_s", "t"), r"has force, but no times \(time_s\): add columns of these names, or"),
        (GOOD.replace("force_y_N", "fy"), "has force of x, z, but of x, y, z it is needed"),
        (GOOD.replace("force_y_N", "force_y"), "'force_y' .* has no unit: write force_y_N or force_y_kN"),
        (GOOD.replace("force_y_N", "force_y_lbf"), "has the unit 'lbf': write force_y_N or force_y_kN"),
        (GOOD.replace("time_s", "time_min"), "has the unit 'min': write time_s or time_ms or time_us or time_ns"),
        (GOOD.replace("force_y_N", "force_x_kN"), "has two columns of one thing, 'force_x_N' and 'force_x_kN'"),
        (GOOD.replace("4,5,6", "4,fünf,6"), r"line 3: force_y_N is 'fünf': write a number or leave it empty"),
        (GOOD.replace("4,5,6", "4,1_0,6"), r"line 3: force_y_N is '1_0': write a number or leave it empty"),
        (GOOD.replace(",", ";").replace("4;", "4,5;"), r"line 3: force_x_N is '4,5': use a decimal point"),
        (GOOD.replace("4,5,6", "4,5"), "line 3: 3 cells for 4 columns"),
        (GOOD.replace("4,5,6", "4,5,6,5"), "line 3: 5 cells for 4 columns: .*decimal point"),
        (GOOD.replace("0.01", "1e9"), r"go from 0 to 1e[+]09 s: check their unit"),
        (GOOD + "\n1.0,7,8,9\n0.3,7,8,9\n", r"line 6: the time goes back by 0\.7 s: give one recording, cut to a part"),
        (GOOD.replace("4,5,6", '4,"5,6'), "is not a CSV file"),
        (b"\xff\xfe\x00time", "is not UTF-8 text"),
        (GOOD.replace("force_z_N", "force_z_N,torque_x_Nm").replace("3\n", "3,0\n"), "has torque of x, but of x, y, z"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path, text, words):
    with pytest.raises(RecordingError, match=words) as error:
        read_force(open_log(written(tmp_path, text), Choice()), Choice())
    assert "\n" not in str(error.value)
    assert "a.csv" in str(error.value)


def test_of_a_column_of_long_lists_only_the_first_places_are_columns(tmp_path, panda_model):
    columns = {"time_s": [0.0, 0.01], "q": [np.append(Q, np.zeros(100_000))] * 2}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=r"names the joints 'q1', .* not the 7 joints of panda"):
        read_joints(tmp_path / "a.parquet", panda_model)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_stamps_of_a_parquet_file_have_the_unit_of_their_type(tmp_path, unit):
    stamps = pa.array(np.array([1_700_000_000, 1_700_000_001]) * 10 ** (3 * ["s", "ms", "us", "ns"].index(unit)))
    columns = {"time_s": stamps.cast(pa.timestamp(unit))} | {f"force_{a}_N": [1.0, 2.0] for a in "xyz"}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet", version="2.6", coerce_timestamps=None)
    assert np.diff(forces_of(tmp_path / "a.parquet").time)[0] == pytest.approx(1e9, abs=512)


def test_text_in_a_column_of_a_parquet_file_is_no_number(tmp_path):
    columns = {"time_s": ["0", "1"]} | {f"force_{a}_N": [1.0, 2.0] for a in "xyz"}
    parquet.write_table(pa.table(columns), tmp_path / "a.parquet")
    with pytest.raises(RecordingError, match=r"'time_s' of .* holds string: give numbers"):
        forces_of(tmp_path / "a.parquet")
