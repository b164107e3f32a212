"""Samples in time, joints by their names, and what cannot be opened."""

import os
from copy import copy
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.errors import RecordingError
from pretouch.imported_data.bags import interpolated
from pretouch.imported_data.log import Choice, Log, check_reach, joint_places
from pretouch.imported_data.reading import open_log, read_joints
from tests.imported_data.files import PANDA

TIMES = st.lists(st.integers(0, 30), min_size=2, max_size=20).filter(lambda times: len(set(times)) > 1)
PLACE = Path("mine.csv")


@pytest.fixture
def log(panda_model):
    """Make a log of a force at instants [ns]."""

    def made(times, values=None):
        numbers = np.arange(len(times), dtype=np.float64) if values is None else values
        rows = np.arange(1, len(times) + 1)
        return Log(PLACE, panda_model, np.array(times, dtype=np.int64), rows, "row {}", {"force": numbers[:, None]}, {})

    return made


def test_each_instant_keeps_the_sample_that_came_last(log):
    @given(TIMES)
    def holds(times):
        ordered, last = log(times).in_order(), {time: float(i) for i, time in enumerate(times)}
        assert ordered.time.tolist() == sorted(last)
        assert ordered.arrays["force"][:, 0].tolist() == [last[time] for time in sorted(last)]
        assert bool(ordered.notes) == (times != sorted(last))

    holds()


def test_rows_that_are_no_numbers_are_left_out_where_asked_and_counted(log):
    rows = log([1, 2, 3, 4], np.array([1.0, np.nan, 3.0, np.inf]))
    assert rows.in_order() is not None
    assert len(rows.in_order()) == 4
    ordered = rows.in_order("force")
    assert ordered.time.tolist() == [1, 3]
    assert [(note.code, note.values["count"]) for note in ordered.notes] == [("not_finite", 2)]
    with pytest.raises(
        RecordingError, match=r"mine\.csv has 2 samples, and 1 of them is usable, 1 repeated: give a longer"
    ):
        log([5, 5]).in_order()


def test_between_samples_that_are_near_values_are_linear_and_elsewhere_unknown(log):
    @given(TIMES, st.lists(st.integers(-5, 40), max_size=10), st.integers(1, 10))
    def holds(times, ticks, longest):
        known = sorted(set(times))
        values = np.sin(np.array(known, dtype=np.float64))
        found = interpolated(log(known, values), "force", np.array(ticks, dtype=np.int64), longest / 1e9)
        for tick, value in zip(ticks, found[:, 0], strict=True):
            before, after = [t for t in known if t <= tick], [t for t in known if t > tick]
            if not before or (after[0] - before[-1] if after else tick - before[-1]) > longest:
                assert np.isnan(value)
            else:
                np.testing.assert_allclose(value, np.interp(tick, known, values), atol=1e-12)

    holds()


NUMBERED = tuple(f"joint_{j}" for j in range(1, 8))


@pytest.mark.parametrize(
    "names",
    [
        PANDA,
        tuple(f"left_{name}" for name in PANDA),
        tuple(f"fr3_joint{j}" for j in range(1, 8)),
        tuple(f"lbr_joint_{j}" for j in range(7)),
        tuple(f"joint{j}/position" for j in range(1, 8)),
    ],
)
def test_joints_are_known_by_their_names_or_numbers_whatever_stands_between(panda_model, names):
    mixed = ["finger_joint1", *names[::-1], "finger_joint2", "torso"]
    assert joint_places(PLACE, mixed, panda_model) == [7, 6, 5, 4, 3, 2, 1]


@pytest.mark.parametrize("names", [PANDA, tuple(f"q{j}" for j in range(1, 8))])
def test_of_two_arms_the_one_of_the_models_names_or_of_our_own_is_taken(panda_model, names):
    other = tuple(f"left_joint{j}" for j in range(1, 8))
    assert joint_places(PLACE, [*other, *names], panda_model) == list(range(7, 14))


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (PANDA[:6], "are not the 7 joints of panda"),
        ((*NUMBERED, "joint_8"), "are not the 7 joints of panda"),
        (("a", "b", "c", "d", "e", "f", "g"), "'a', 'b', .* are not the 7 joints of panda .*choose another --arm"),
        (tuple(f"{arm}_joint{j}" for arm in "ab" for j in range(1, 8)), "are 2 arms of the 7 joints"),
        ((), "names the joints none"),
    ],
)
def test_joints_are_never_taken_by_their_order(panda_model, names, words):
    with pytest.raises(RecordingError, match=words):
        joint_places(PLACE, names, panda_model)


def test_positions_out_of_the_arms_range_are_refused_and_degrees_are_named(panda_model):
    q = np.tile(panda_model.description.q_ready, (3, 1))
    check_reach(PLACE, q, panda_model)
    with pytest.raises(RecordingError, match=r"is at -45 rad, .* name the columns q1_deg and so on"):
        check_reach(PLACE, np.degrees(q), panda_model)
    with pytest.raises(RecordingError, match=r"panda_joint2 .* is at -78\.54 rad, .*: check the unit and the arm"):
        check_reach(PLACE, 100 * q, panda_model)


def test_one_endless_joint_may_count_many_turns_and_two_are_in_degrees(panda_model):
    arm = copy(panda_model)
    arm.q_min, arm.q_max = panda_model.q_min.copy(), panda_model.q_max.copy()
    arm.q_min[[0, 6]], arm.q_max[[0, 6]] = -2 * np.pi, 2 * np.pi
    q = np.tile(panda_model.description.q_ready, (3, 1))
    q[:, 6] = [6.0, 9.0, 31.0]
    check_reach(PLACE, q, arm)
    q[:, 0] = -90.0
    with pytest.raises(RecordingError, match=r"panda_joint1 .* is at -90 rad"):
        check_reach(PLACE, q, arm)


@pytest.mark.parametrize(
    ("name", "choice", "words"),
    [
        ("none.csv", {}, "does not exist"),
        ("x" * 300, {}, "does not exist"),
        ("a.xlsx", {}, "has an unknown format: give a file that ends in .mcap, .db3, .bag, .csv"),
        ("folder", {}, "has no metadata.yaml"),
        ("pipe.csv", {}, "is no file"),
        ("a.csv", {"wrench": "/w"}, "is a table and has no topics"),
        ("a.csv", {"torques": "/x"}, "has no topics: leave out"),
        ("a.csv", {}, "is empty"),
        ("a.mcap", {}, "cannot be read as a bag or MCAP file"),
        ("a.parquet", {}, "cannot be read as a Parquet file"),
    ],
)
def test_what_cannot_be_opened_is_one_sentence_for_all_that_read(tmp_path, panda_model, name, choice, words):
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe.csv")
    for there in ("a.xlsx", "a.csv", "a.mcap", "a.parquet"):
        (tmp_path / there).touch()
    with pytest.raises(RecordingError, match=words) as caught:
        open_log(tmp_path / name, Choice(**choice))
    assert "\n" not in str(caught.value)
    if not choice:
        with pytest.raises(RecordingError, match=words):
            read_joints(tmp_path / name, panda_model)
