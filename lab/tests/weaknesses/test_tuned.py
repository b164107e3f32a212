import numpy as np
import pytest
from lab.tests.rows import made_up
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.sim.plant import Touch
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.experiment import Sources
from pretouch_lab.weaknesses import tuned

STRICT = "paper:approach.v_max_m_s=0.04:approach.slack_weight=1000"
FLOOR = "paper:approach.rows=floor"
QUICK = "paper:approach.v_max_m_s=0.4:approach.slack_weight=1000"


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
    assert 5.0 < row["rest_s"] < 23.0
    assert row["speed_left_m_s"] < 0.002
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
    assert tuned.rest_time(times, np.array([0.0, 0.3, 0.0015, 0.0021, 0.0019, 0.001])) == 4.0
    assert tuned.rest_time(times, np.full(6, 0.3)) is None
    assert tuned.rest_time(times, np.zeros(6)) is None


def test_the_speed_is_that_of_the_way_in_two_seconds():
    times = np.arange(501) * 0.01
    # 3 s at 20 mm/s, then a stand with a jitter of 1 mm from step to step
    along = np.minimum(times, 3.0) * 0.02 + np.where(times > 3.0, 0.001 * (-1.0) ** np.arange(501), 0.0)
    place = [np.array([0.4, y, 0.5]) for y in along]
    begins, speed = tuned.displacement_speed(made_up(times, ee_position=place))
    assert len(begins) == len(speed) == 301
    assert (begins[0], begins[-1]) == pytest.approx((0.0, 3.0))
    assert speed[:100] == pytest.approx(0.02)
    assert speed[200] == pytest.approx((0.02 * 1.0 + 0.001) / 2.0)
    assert speed[-1] == pytest.approx(0.0005)
    # below 2 mm/s when less than 4 mm are left: from 2.85 s on, at the latest
    assert tuned.rest_time(begins, speed) == pytest.approx(2.85, abs=0.011)


def test_of_a_short_record_there_is_no_speed():
    times = np.arange(100) * 0.01
    begins, speed = tuned.displacement_speed(made_up(times, ee_position=[np.zeros(3)] * 100))
    assert len(begins) == len(speed) == 0


def test_the_closing_speed_counts_both_motions_but_not_a_sliding_past():
    hand = [[0.0, 0.004 * i, 0.0] for i in range(10)]
    touch = Touch(0.085, 1, np.array([0.3, 0.1, 0.0]))
    record = made_up(np.arange(10) * 0.01, touches=[touch], hand=hand)
    assert tuned.closing_speed(record, still=False) == pytest.approx(0.4 - 0.1)
    assert tuned.closing_speed(record, still=True) == pytest.approx(0.1)


def test_an_arm_that_comes_back_to_a_hand_that_stands_closes_along_the_way_the_hand_came():
    hand = [[0.0, 0.004 * min(i, 10), 0.0] for i in range(30)]
    touch = Touch(0.285, 1, np.array([0.3, -0.05, 0.0]))
    record = made_up(np.arange(30) * 0.01, touches=[touch], hand=hand)
    assert tuned.closing_speed(record, still=False) == pytest.approx(0.05)


def test_cells_are_all_tunings_in_all_scenes():
    cells = tuned.cells(Grid(("blind", "paper")))
    assert len(cells) == 3 * (2 * 4 + 2)
    assert {c.where["scene"] for c in cells} == {"circle", "line", "reach"}
    assert len({c.name for c in cells}) == len(cells)
    assert {(c.profile, c.where["restrictions"]) for c in cells} >= {
        (STRICT, "slack"),
        ("paper", "hard"),
        ("paper", "off"),
    }
    assert not any("blind" in c.profile for c in cells)


def test_a_profile_named_with_a_mode_is_taken_as_it_is():
    cells = tuned.cells(Grid((FLOOR, FLOOR)))
    assert [(c.where["scene"], c.profile, c.where["restrictions"]) for c in cells] == [
        (scene, FLOOR, "floor") for scene in tuned.SCENES
    ]


@pytest.mark.parametrize(
    ("name", "mode", "found"),
    [(STRICT, "slack", "paper"), ("paper", "off", "paper"), (STRICT, "hard", STRICT), (FLOOR, "floor", FLOOR)],
)
def test_the_base_of_a_tuning_is_its_name_without_the_tuning(name, mode, found):
    cell = {"profile": name, "restrictions": mode, "v_max_m_s": 0.04, "slack_weight": 1000.0}
    assert tuned.base(cell) == found


def test_a_summary_of_any_rows_makes_tables_that_fit(strict, reached):
    row, hit = strict[0], reached["off"][0]
    part = tuned.summarise([row, hit, row | {"seed": 1, "contact": True, "rest_s": None, "speed_left_m_s": None}])
    still, moving = part["cells"]
    assert (still["trials"], still["contact_fraction"], moving["contact_fraction"]) == (2, 0.5, 1.0)
    tables = tuned.tables(part)
    assert len(tables) == 2
    assert all(width(table) <= 80 for table in tables)
    (alone,) = tuned.tables(tuned.summarise([row]))
    assert alone.rows[0][0] == "line"


def test_cells_of_two_profiles_are_told_apart(strict):
    row = strict[0]
    names = {STRICT: "slack", STRICT.replace("paper", "thresholds-only"): "slack", FLOOR: "floor"}
    rows = [row | {"profile": name, "restrictions": mode} for name, mode in names.items()]
    summary = tuned.summarise(rows)
    (table,) = tuned.tables(summary)
    assert [r[0] for r in table.rows] == [
        "line\npaper", "line\nthresholds-only", "line\npaper\napproach.rows=floor",
    ]  # fmt: skip
    assert width(table) <= 80
    (picture,) = tuned.EXPERIMENT.draw(Sources(summary, lambda _: None, ()))
    left, _ = picture.figure.axes
    labels = [line.get_label() for line in left.lines]
    assert labels == ["line, weight 1000,\npaper", "line, weight 1000,\nthresholds-only"]
    assert len({line.get_marker() for line in left.lines}) == 2
