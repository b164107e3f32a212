"""CSV files: names, units, separators, gaps in cells, and what is wrong with them in one sentence."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.errors import RecordingError
from pretouch.imported_data.samples import read_imported
from pretouch.imported_data.source import Choice
from tests.imported_data.files import force_columns, write_csv

FORCE = np.random.default_rng(0).normal(size=(50, 3))
EE = Choice(frame="ee")
Q = np.array([0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.7])
GOOD = "time_s,force_x_N,force_y_N,force_z_N\n0.00,1,2,3\n0.01,4,5,6\n"


def written(tmp_path, text, name="a.csv"):
    file = tmp_path / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return file


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_separators_and_line_endings_make_no_difference(tmp_path, separator, ending):
    found = read_imported(write_csv(tmp_path / "a.csv", force_columns(FORCE), separator, ending), Choice())
    np.testing.assert_array_equal(found.force.values, FORCE)
    np.testing.assert_array_equal(found.force.time, np.arange(50) * 10_000_000)
    assert found.notes == ()


@pytest.mark.parametrize(
    ("header", "factor"),
    [
        ("TIME_S,Force_X_n,FORCE_Y_N,force_z_N", 1.0),
        ("# time_s, force_x_N, force_y_N, force_z_N", 1.0),
        ('"time_s","force_x_N","force_y_N","force_z_N"', 1.0),
        ("\ufefftime_s,force_x_N,force_y_N,force_z_N", 1.0),
        ("time_s,force_x_kN,force_y_kN,force_z_kN", 1000.0),
        ("\n\ntime_s,force_x_N,force_y_N,force_z_N", 1.0),
    ],
)
def test_headers_are_read_as_people_write_them(tmp_path, header, factor):
    found = read_imported(written(tmp_path, f"{header}\n0.0,1,2,3\n0.01,4,5,6\n\n"), Choice())
    np.testing.assert_array_equal(found.force.values, factor * np.array([[1, 2, 3], [4, 5, 6]]))


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_units_of_time_are_converted(tmp_path, unit, per_second):
    columns = force_columns(FORCE)
    seconds = columns.pop("time_s") + 1.7e9
    found = read_imported(write_csv(tmp_path / "a.csv", {f"time_{unit}": seconds * per_second} | columns), Choice())
    np.testing.assert_allclose(found.force.time, np.arange(50) * 1e7, atol=1e3)


def test_degrees_and_radians_are_the_same_posture(tmp_path):
    def turned(unit, factor):
        columns = force_columns(FORCE) | {f"q{i + 1}_{unit}": np.full(50, factor * Q[i]) for i in range(7)}
        return read_imported(write_csv(tmp_path / f"{unit}.csv", columns), EE).force.values

    np.testing.assert_allclose(turned("deg", 180 / np.pi), turned("rad", 1.0), atol=1e-12)


def test_joints_are_taken_by_their_numbers_not_their_places(tmp_path):
    columns = {f"q{i + 1}_rad": np.full(50, Q[i]) for i in reversed(range(7))} | force_columns(FORCE)
    found = read_imported(write_csv(tmp_path / "a.csv", columns), EE)
    np.testing.assert_array_equal(found.joints.values, np.tile(Q, (50, 1)))


def test_empty_cells_are_no_estimate_and_rows_without_time_are_left_out(tmp_path):
    text = GOOD + "0.02,,8,9\n,1,1,1\n0.03,nan,1,1\n0.04,1,2,inf\n0.05,7,8,9\n"
    found = read_imported(written(tmp_path, text), Choice())
    np.testing.assert_array_equal(np.isnan(found.force.values[:, 0]), [False, False, True, True, True, False])
    assert found.notes[0] == "1 row has no time and was left out."
    assert "3 samples are not finite and count" in found.notes[1]


def test_columns_of_no_use_are_named(tmp_path):
    found = read_imported(written(tmp_path, GOOD.replace("time_s", "torso,time_s").replace("\n0", "\n9,0")), Choice())
    assert found.notes == ("Columns that are not used: 'torso'.",)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        ("\n\n \n", "is empty"),
        ("time_s,force_x_N,force_y_N,force_z_N\n", "has no row with a time"),
        (GOOD[:46], "has 1 sample of the force"),
        (GOOD.replace("time_s", "t"), "has no column time "),
        (GOOD.replace("force_y_N", "fy"), "has no column force_y "),
        (GOOD.replace("force_y_N", "force_y"), "'force_y' .* has no unit: write force_x_N or force_x_kN"),
        (GOOD.replace("force_y_N", "force_y_lbf"), "has the unit 'lbf': write force_x_N or force_x_kN"),
        (GOOD.replace("time_s", "time_min"), "has the unit 'min': write time_s, time_ms, time_us or time_ns"),
        (GOOD.replace("force_y_N", "force_x_kN"), "has two columns for force_x, 'force_x_N' and 'force_x_kN'"),
        (GOOD.replace("4,5,6", "4,fünf,6"), r"line 3: force_y_N is 'fünf': write a number or leave it empty"),
        (GOOD.replace(",", ";").replace("4;", "4,5;"), r"line 3: force_x_N is '4,5': use a decimal point"),
        (GOOD.replace("4,5,6", "4,5"), "line 3: 3 cells for 4 columns"),
        (GOOD.replace("0.01", "1e9"), "span 1e[+]09 s: check their unit"),
        (GOOD.replace("4,5,6", '4,"5,6'), "is not a CSV file"),
        (b"\xff\xfe\x00time", "is not UTF-8 text"),
        (GOOD.replace("force_z_N", "force_z_N,torque_x_Nm"), "only some of torque_x, torque_y and torque_z"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(tmp_path, text, words):
    with pytest.raises(RecordingError, match=words) as error:
        read_imported(written(tmp_path, text), Choice())
    assert "\n" not in str(error.value)
    assert "a.csv" in str(error.value)


@pytest.mark.parametrize(
    ("choice", "words"),
    [
        (Choice(wrench="/w"), "has no topics"),
        (EE, "has no joint positions"),
    ],
)
def test_what_a_csv_file_cannot_give_is_said(tmp_path, choice, words):
    with pytest.raises(RecordingError, match=words):
        read_imported(written(tmp_path, GOOD), choice)


def test_another_number_of_joints_than_the_arm_has_is_refused(tmp_path):
    columns = force_columns(FORCE) | {f"q{i}_rad": np.zeros(50) for i in range(1, 7)}
    with pytest.raises(RecordingError, match="has 6 joints, and panda has 7"):
        read_imported(write_csv(tmp_path / "a.csv", columns), EE)


def test_degrees_taken_for_radians_are_noticed(tmp_path):
    columns = force_columns(FORCE) | {f"q{i + 1}_rad": np.full(50, np.degrees(Q[i])) for i in range(7)}
    with pytest.raises(RecordingError, match=r"panda_joint1 .* is at 5\.73 rad, out of its range"):
        read_imported(write_csv(tmp_path / "a.csv", columns), EE)


NAMES = st.sampled_from(
    [
        "time_s",
        "time_ms",
        "force_x_N",
        "force_y_N",
        "force_z_N",
        "torque_x_Nm",
        "q1_rad",
        "q1_deg",
        "force_x",
        "q_rad",
        "",
    ]
)
CELLS = st.one_of(
    st.floats().map(repr),
    st.integers().map(str),
    st.text(max_size=5),
    st.sampled_from(["", "nan", '"', "1,5", "1e999"]),
)
TABLES = st.builds(
    lambda names, rows, separator: "\n".join(separator.join(row) for row in [names, *rows]),
    st.one_of(
        st.lists(NAMES, max_size=8), st.just(["time_s", "force_x_N", "force_y_N", "force_z_N"]), st.lists(st.text())
    ),
    st.lists(st.lists(CELLS, max_size=8), max_size=6),
    st.sampled_from(",;\t"),
)


def read_or_refused(file, choice):
    """Return what was read, or our error's sentence; any other exception is a failure."""
    try:
        return read_imported(file, choice)
    except RecordingError as error:
        return str(error)


@given(st.one_of(TABLES.map(lambda text: text.encode("utf-8", "surrogatepass")), st.binary(max_size=200)))
def test_junk_gives_a_recording_or_our_error_and_nothing_else(tmp_path_factory, junk):
    file = tmp_path_factory.getbasetemp() / "junk.csv"
    file.write_bytes(junk)
    for choice in (Choice(), EE):
        found = read_or_refused(file, choice)
        if isinstance(found, str):
            assert "\n" not in found
        else:
            assert found.force.values.shape == (len(found.force), 3)
            assert np.all(np.diff(found.force.time) > 0)
