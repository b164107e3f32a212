import numpy as np
import pytest
from tests.experiments.limits import assert_within_limits
from tests.experiments.rows import made_up
from tests.experiments.width import width

from pretouch.experiments.cell import Cell, Grid
from pretouch.experiments.weaknesses import tuned
from pretouch.sim.plant import Touch

STRICT = "paper:restriction.v_max_m_s=0.04:restriction.slack_weight=1000"
QUICK = "paper:restriction.v_max_m_s=0.4:restriction.slack_weight=1000"


def cell(scene, name, mode="slack"):
    return Cell(tuned.NAME, name, {"scene": scene, "restrictions": mode})


@pytest.fixture(scope="module")
def strict(context):
    return tuned.trial(cell("line", STRICT), 180, context)


@pytest.fixture(scope="module")
def reached(context):
    return {mode: tuned.trial(cell("reach", QUICK, mode), 181, context) for mode in ("off", "slack")}


def test_a_static_object_that_a_unit_sees_is_avoided(strict, panda_model):
    row, record = strict
    assert (row["v_max_m_s"], row["slack_weight"]) == (0.04, 1000.0)
    assert row["contact"] is False
    assert 0.1 < row["least_sensed_m"] < 0.4
    assert row["speed_left_m_s"] < 0.01
    assert row["gave_way_m"] is None
    assert_within_limits(record, panda_model)


def test_a_hand_that_comes_meets_an_arm_that_gives_way_more_softly(reached, panda_model):
    off, slack = (reached[mode][0] for mode in ("off", "slack"))
    assert off["contact"] is True
    assert off["impact_speed_m_s"] == pytest.approx(0.35, abs=0.05)
    assert off["gave_way_m"] < 0.01
    assert slack["gave_way_m"] > 0.02
    assert slack["impact_speed_m_s"] is None or slack["impact_speed_m_s"] < 0.25
    for _, record in reached.values():
        assert_within_limits(record, panda_model)


def test_rest_is_when_a_moving_arm_is_slow_for_good():
    times = np.arange(6.0)
    assert tuned.rest_time(times, np.array([0.0, 0.3, 0.004, 0.02, 0.004, 0.001])) == 4.0
    assert tuned.rest_time(times, np.full(6, 0.3)) is None
    assert tuned.rest_time(times, np.zeros(6)) is None


def test_the_speed_is_that_of_half_a_second():
    back_and_forth = [np.array([0.1 * (-1) ** i, 0.02, 0.0]) for i in range(100)]
    speed = tuned.smooth_speed(made_up(np.arange(100) * 0.01, ee_velocity=back_and_forth))
    assert len(speed) == 100
    assert speed[-1] == pytest.approx(0.02)


def test_the_closing_speed_counts_both_motions():
    hand = [[0.0, 0.004 * i, 0.0] for i in range(10)]
    touch = Touch(0.085, 1, np.array([0.0, 0.1, 0.0]))
    record = made_up(np.arange(10) * 0.01, touches=[touch], hand=hand)
    assert tuned.closing_speed(record, still=False) == pytest.approx(0.4 - 0.1)
    assert tuned.closing_speed(record, still=True) == pytest.approx(0.1)


def test_cells_are_all_tunings_in_all_scenes():
    cells = tuned.cells(Grid(("blind", "paper")))
    assert len(cells) == 4 * (2 * 4 + 2)
    assert len({c.name for c in cells}) == len(cells)
    assert {(c.profile, c.where["restrictions"]) for c in cells} >= {
        (STRICT, "slack"),
        ("paper", "hard"),
        ("paper", "off"),
    }
    assert not any("blind" in c.profile for c in cells)


def test_a_summary_of_any_rows_makes_tables_that_fit(strict, reached):
    row, hit = strict[0], reached["off"][0]
    part = tuned.summarise([row, hit, row | {"seed": 1, "contact": True, "rest_s": None, "speed_left_m_s": None}])
    still, moving = part["cells"]
    assert (still["trials"], still["contact_fraction"], moving["contact_fraction"]) == (2, 0.5, 1.0)
    tables = tuned.tables(part)
    assert len(tables) == 2
    assert all(width(table) <= 80 for table in tables)
    assert len(tuned.tables(tuned.summarise([row]))) == 1
