import json
from dataclasses import replace

import numpy as np
import pytest
from lab.tests.rows import made_up
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.hardware.traffic import UnitTraffic
from pretouch.hardware.wire import Sample
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.studies import wire

pytestmark = pytest.mark.slow

PLACES = [("circle", "-y"), ("circle", "+y"), ("line", "-y"), ("line", "+y")]


def cell(readings: str, place=("line", "+y")) -> Cell:
    trajectory, side = place
    return Cell(wire.NAME, "paper", {
        "trajectory": trajectory, "side": side, "readings": readings, "restrictions": "off",
    })  # fmt: skip


def test_cells_are_all_places_and_all_ways_of_each_profile_that_senses():
    cells = wire.cells(Grid(("blind", "paper")))
    assert len({cell.name for cell in cells}) == len(cells) == 16
    assert {(c.where["trajectory"], c.where["side"]) for c in cells} == set(PLACES)
    assert {c.where["readings"] for c in cells} == {"in process", "0 %", "10 %", "30 %"}
    assert {(c.profile, c.where["restrictions"]) for c in cells} == {("paper", "off")}


@pytest.fixture(scope="module")
def trials(context):
    return {way: wire.trial(cell(way), 1, context) for way in ("in process", "0 %", "30 %")}


def test_a_trial_meets_the_same_board_however_the_readings_come(trials):
    for row, record in trials.values():
        assert row["contact"]
        assert row["detection_delay_s"] is not None
        assert record.steps[-1].stamp < 20.0
        json.dumps(row, allow_nan=False)


def test_readings_over_the_wire_are_older_and_lost_as_asked_for(trials):
    rows = {way: row for way, (row, _) in trials.items()}
    assert rows["in process"]["age_median_s"] < rows["0 %"]["age_median_s"] < rows["30 %"]["age_median_s"] < 0.06
    assert rows["in process"]["age_p99_s"] < rows["0 %"]["age_p99_s"] < rows["30 %"]["age_p99_s"]
    assert (rows["in process"]["lost"], rows["0 %"]["lost"]) == (None, 0.0)
    assert rows["30 %"]["lost"] == pytest.approx(0.3, abs=0.05)


def test_a_trial_can_be_repeated_bit_for_bit(trials, context):
    row, record = trials["30 %"]
    again, other = wire.trial(cell("30 %"), 1, context)
    assert again == row
    assert np.array_equal(record.reading_age, other.reading_age)
    assert [s.command.tobytes() for s in record.steps] == [s.command.tobytes() for s in other.steps]


def test_no_command_exceeds_a_limit(trials, panda_model):
    for _, record in trials.values():
        assert_within_limits(record, panda_model)


def unit(accepted: int, sequence: int, sessions: int = 1) -> UnitTraffic:
    fields = dict.fromkeys(Sample.__dataclass_fields__, 0) | {"sequence": sequence, "imu": b""}
    return UnitTraffic("unit", 1, accepted=accepted, sessions=sessions, sample=Sample(**fields))


def test_what_is_missing_is_told_by_units_that_kept_their_session():
    made = made_up([1.0, 2.0, 3.0])
    made = replace(
        made, reading_age=np.array([[9.0, np.inf], [0.03, 0.05], [0.04, 0.06]]),
        traffic=(unit(90, 100), unit(60, 100), unit(300, 20, sessions=3), UnitTraffic("mute", 2)),
    )  # fmt: skip
    found = wire.coming_in(made)
    assert (found["lost"], found["sessions_left"]) == (0.25, 2)
    assert found["age_median_s"] == pytest.approx(0.045)
    assert wire.coming_in(made_up([1.0])) == {
        "age_median_s": None, "age_p99_s": None, "lost": None, "sessions_left": 0,
    }  # fmt: skip


def row(readings: str, force: float, place=("line", "+y"), seed: int = 0, **changes) -> dict:
    return {
        "experiment": "wire", **cell(readings, place).where, "profile": "paper", "seed": seed, "contact": True,
        "impact_speed_m_s": 0.1, "filtered_at_detection_n": force, "raw_at_detection_n": 2 * force,
        "peak_estimate_n": 2 * force, "true_peak_20ms_n": 3 * force, "age_median_s": 0.03, "age_p99_s": 0.06,
        "lost": None if readings == "in process" else 0.1, "sessions_left": 0, "false_detections": 0, "held": False,
    } | changes  # fmt: skip


def test_a_change_of_more_than_15_percent_of_any_force_fails():
    rows = [row("in process", 10.0), row("0 %", 11.4), row("10 %", 10.0, raw_at_detection_n=16.9)]
    rows += [row("30 %", 10.0, peak_estimate_n=None), row("30 %", 8.6, place=("circle", "-y"))]
    summary = wire.summarise(rows)
    verdict = {(c["trajectory"], c["readings"]): c.get("within") for c in summary["cells"]}
    assert verdict["line", "0 %"] is True
    assert verdict["line", "10 %"] is False, "0.845 of the raw force"
    assert verdict["line", "30 %"] is False, "a force that never was is not within"
    assert verdict["circle", "30 %"] is None, "there is nothing to compare with"
    assert verdict["line", "in process"] is None
    assert verdict["all", "30 %"] is True, "of all places together"
    forces, coming = wire.tables(summary)
    shown = {tuple(r[:2]): r for r in forces.rows}
    assert shown["line\n+y", "0 %"][-1] == "within"
    assert shown["line\n+y", "0 %"][3] == "11.4\n1.14"
    assert shown["line\n+y", "10 %"][-1] == "FAILS"
    assert [r[1] for r in coming.rows] == ["in process", "0 %", "10 %", "30 %"]
    assert [r[2] for r in coming.rows] == ["-", "10.0", "10.0", "10.0"]
    assert max(width(table) for table in (forces, coming)) <= 80


def test_profiles_stand_apart_in_the_tables():
    rows = [row("in process", 10.0), row("0 %", 10.0)]
    rows += [r | {"profile": "slowing-only"} for r in rows]
    forces, _ = wire.tables(wire.summarise(rows))
    assert len({r[:2] for r in forces.rows}) == 8


@pytest.mark.slow
def test_over_twelve_seeds_the_median_forces_stay_within_15_percent(context):
    rows = [wire.trial(one, seed, context)[0] for seed in range(12) for one in wire.cells(Grid(("paper",)))]
    summary = wire.summarise(rows)
    failing = [
        (c["trajectory"], c["side"], c["readings"], c["ratios"])
        for c in summary["cells"]
        if "within" in c and not c["within"]
    ]
    assert failing == []
    assert all(c["false_detections"] == 0 for c in summary["cells"])
    assert all(c["contact_fraction"] == 1.0 for c in summary["cells"])
