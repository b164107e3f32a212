import json
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.robot.ik import brought_to
from pretouch.sim.paper_scenes import static_scene
from pretouch.sim.plant import Plant
from pretouch.sim.plant_params import PlantParams
from pretouch.types import Mode
from pretouch_lab.cell import Cell
from pretouch_lab.weaknesses import dropout


def test_lost_readings_are_counted_by_the_gaps_in_what_came_through():
    loss = dropout.Loss(skin=None, begin=1.0, end=1.04, facing=[0, 2])
    through = [(0.99, 0.98, 0.985), (0.99, 1.0, 0.985), (1.051, 1.02, 1.004), (1.07, 1.04, 1.046)]
    # unit 0: 61 ms without one, so two lost; unit 2: 42 ms, so one; unit 1 does not count
    loss.stamps = [np.array(stamps) for stamps in through]
    assert loss.lost() == [2, 1]


def test_the_units_that_see_a_board_are_those_on_its_side(panda_model, paper_skin):
    for side, expected in (("-y", "hand_right"), ("+y", "hand_left")):
        scene = static_scene("line", side, 25e3, 100)
        plant = Plant(panda_model, scene, PlantParams(), brought_to(panda_model, np.array([0.4, 0.0, 0.5])), 100)
        names = {paper_skin.ids[unit] for unit in dropout.facing(plant, paper_skin, "object")}
        assert expected in names
        assert not names & {"hand_left", "hand_right"} - {expected}


def cell(readings, profile="paper"):
    return Cell(dropout.NAME, profile, {"readings": float(readings), "restrictions": "slack"})


@pytest.fixture(scope="module")
def trials(context):
    return {n: dropout.trial(cell(n), 101, context) for n in (0, 3, 20)}


def test_as_many_readings_are_lost_as_were_silenced_and_no_command_exceeds_a_limit(trials, panda_model):
    for n, (row, record) in trials.items():
        assert row["command_step"] <= 1.0
        assert_within_limits(record, panda_model)
        assert row["units"]
        assert all(abs(lost - n) <= 1 for lost in row["lost"])
        json.dumps(row, allow_nan=False)


def test_up_to_the_loss_all_trials_of_a_seed_are_the_same(trials):
    (a, b), loss = (trials[n][1].steps for n in (0, 20)), 2.0
    assert all(np.array_equal(x.command, y.command) for x, y in zip(a, b, strict=False) if x.stamp < loss)


def test_where_no_acceleration_limit_binds_the_free_answer_is_the_command(trials, context, panda_model):
    row, rec = trials[0]
    upright = panda_model.kinematics(rec.steps[0].q).rotation[panda_model.ee]
    reach, free = panda_model.description.qdd_max * 0.01, 0
    for last, now in pairwise([s for s in rec.steps if s.stamp > 2.0]):
        if np.all(np.abs(now.command - last.command) < 0.99 * reach):
            answer = dropout.free_answer(now, upright, context.profile(cell(0)), panda_model)
            assert answer == pytest.approx(now.command, abs=1e-4)
            free += 1
    assert free > 20
    assert row["free_step"] >= row["command_step"] - 1e-3


def test_a_point_outlives_no_more_readings_than_its_persistence(trials):
    # three lost readings are a gap of 80 ms, a point is kept for 60 ms
    row, rec = trials[3]
    assert row["rows_vanished"] >= 1
    assert any(a.obstacles.unit.size and not b.obstacles.unit.size for a, b in pairwise(rec.steps))


def test_a_long_loss_is_silence_and_ends_in_a_hold(trials):
    row, rec = trials[20]
    assert row["holds"] == 1
    assert row["least_scale"] == 0.0
    held = next(s for s in rec.steps if s.stamp > 2.0 and s.mode is Mode.HOLD)
    assert any(unit in held.reason for unit in row["units"])


def test_the_largest_steps_are_those_of_the_record(trials):
    row, rec = trials[3]
    watched = [s for s in rec.steps if s.stamp > 1.99]
    upper = np.abs(np.diff([s.thresholds.upper[1] for s in watched])).max()
    lower = np.abs(np.diff([s.thresholds.lower[1] for s in watched])).max()
    assert row["threshold_step_n"] == pytest.approx(max(upper, lower), abs=1e-3)
    assert row["scale_rise"] == pytest.approx(max(np.diff([s.speed_scale for s in watched])), abs=1e-4)
    assert row["towards_most_m_s"] > row["towards_before_m_s"]


def row(readings, seed=0, profile="paper", **changes):
    where = {"readings": float(readings), "restrictions": "slack"}
    return {
        "experiment": "dropout", **where, "profile": profile, "seed": seed, "gap_m": 0.3, "units": ["hand_left"],
        "lost": [readings], "threshold_step_n": 2.0, "limit_step_m_s": 0.001, "rows_vanished": 1, "command_step": 1.0,
        "free_step": 2.5, "least_scale": 0.4, "largest_scale": 0.5, "scale_rise": 0.0025, "towards_before_m_s": 0.01,
        "towards_most_m_s": 0.1, "holds": 0, "reactions": 0,
    } | changes  # fmt: skip


def test_a_summary_is_made_of_whatever_rows_there_are():
    rows = [row(3), row(3, 1, lost=[3, 2], rows_vanished=0, limit_step_m_s=None), row(0, rows_vanished=0)]
    rows.append(row(20, profile="paper:perception.persistence_s=0.021", free_step=None, holds=1))
    summary = dropout.summarise(rows)
    three, none, long = summary["cells"]
    assert (three["trials"], three["trials_without_rows"], three["lost"]["n"]) == (2, 1, 3)
    assert three["limit_step_m_s"]["n"] == 1
    assert (none["trials_without_rows"], long["free_step"], long["holds"]) == (0, None, 1)
    (table,) = dropout.tables(summary)
    assert [r[:3] for r in table.rows] == [("paper\n60 ms", "0", "0"), ("", "3", "3"), ("paper\n21 ms", "20", "20")]
    assert table.rows[1][5] == "1/2"
    assert width(table) <= 80


def test_a_unit_that_sees_the_board_now_and_then_counts_for_no_row():
    def seeing(stamp, *units):
        found = SimpleNamespace(unit=np.array(units, dtype=np.int64))
        return SimpleNamespace(stamp=stamp, obstacles=found, restricted=np.arange(len(units)))

    before = [seeing(1.75, 3), seeing(1.85, 1, 3, 4), seeing(1.9, 3, 1), seeing(1.95, 3, 4)]
    assert dropout.steady(before, SimpleNamespace(begin=2.0, facing=[1, 3])) == [3]
