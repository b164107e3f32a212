import numpy as np
import pytest
from lab.tests.rows import made_up
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.sim.plant import Touch
from pretouch.types import Mode
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.paper.avoidance import gaps
from pretouch_lab.weaknesses import creeping

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def slack(context):
    return creeping.trial(Cell(creeping.NAME, "paper", {"restrictions": "slack"}), 140, context)


def test_with_restrictions_the_arm_creeps_up_to_the_hand_but_does_not_touch(slack, panda_model):
    row, record = slack
    assert row["contact"] is False
    assert row["contacts"] == 0
    assert (
        0.1
        < row["distance_30s_m"]
        <= row["distance_20s_m"]
        <= row["distance_10s_m"]
        <= row["distance_5s_m"]
        < row["distance_2s_m"]
        < 0.6
    )
    assert 0.0 < row["creep_m_s"] < 0.02
    assert 0.5 < row["recovery_s"] < 4.0
    assert_within_limits(record, panda_model)


def test_in_mode_floor_the_arm_has_the_time_to_reach_the_hand(context, panda_model):
    row, record = creeping.trial(Cell(creeping.NAME, "paper", {"restrictions": "floor"}), 140, context)
    touch = record.first_contact()
    assert row["contact"] is True
    assert row["least_distance_m"] < 0.001
    # 0.02 m/s is the floor: from where it is the limit on, 0.2 m take 10 s
    assert row["distance_10s_m"] - row["distance_20s_m"] == pytest.approx(0.2, abs=0.02)
    assert touch == pytest.approx(creeping.visit(140).arrive + 20 + row["distance_20s_m"] / 0.02, abs=0.5)
    assert_within_limits(record, panda_model)


def test_the_hand_stays_for_thirty_seconds():
    visit = creeping.visit(140)
    assert visit.leave - visit.arrive == 30.0


def test_without_proximity_the_arm_runs_into_the_hand(context, monkeypatch):
    for name, value in {"_LEAVES_S": 13.0, "_LOOKS_S": (2, 5, 10), "_COURSE_S": np.arange(0.0, 10.5, 0.5)}.items():
        monkeypatch.setattr(creeping, name, value)
    row, _ = creeping.trial(Cell(creeping.NAME, "blind", {"restrictions": "off"}), 140, context)
    assert row["contact"] is True
    assert row["contacts"] >= 2
    assert row["true_peak_20ms_n"] > 20
    assert row["least_distance_m"] < 0.001


def test_distances_are_from_the_arms_surface_to_the_hands(context, panda_model):
    q = panda_model.description.q_ready
    kin = panda_model.kinematics(q)
    last = panda_model.link_index("panda_hand")
    end = kin.position[last] + kin.rotation[last] @ np.array([0.0, 0.0, 0.1006])
    down = kin.rotation[last] @ np.array([0.0, 0.0, 1.0])
    ee = kin.position[panda_model.ee]
    # the capsule of the fingers ends at 0.1006 m with a radius of 0.0115 m; the fist has one of 0.05 m
    hand = end + (0.0115 + 0.2 + 0.05) * down
    record = made_up([0.0], hand=[hand], q=[q], ee_position=[ee], ee_velocity=[0.1 * down])
    assert gaps(record, context.model, 0.05) == pytest.approx([0.2], abs=1e-4)
    assert creeping.speed_towards(record) == pytest.approx([0.1])


def test_the_numbers_of_a_made_up_trial():
    times = np.arange(2.0, 36.0, 0.5)
    gap = 40.0 - times
    towards = np.where(times < 23.0, 0.2, 0.01)
    touches = [Touch(t, 1, np.zeros(3)) for t in (5.0, 5.3, 9.0)]
    force = np.zeros((len(times), 3))
    force[10] = [0.0, 3.0, 4.0]
    velocity = [np.array([0.28 if t >= 35.0 else 0.0, 0.0, 0.0]) for t in times]
    mode = [Mode.REACT if t == 35.0 else Mode.TRACK for t in times]
    record = made_up(times, force, touches, ee_velocity=velocity, mode=mode)
    row = creeping.results(record, gap, towards, 0.3)
    assert [row[f"distance_{k}s_m"] for k in (2, 5, 10, 20, 30)] == [35.0, 32.0, 27.0, 17.0, 7.0]
    assert (row["course_m"][0], row["course_m"][1], row["course_m"][-1]) == (37.0, 36.5, 7.0)
    assert row["least_distance_m"] == 7.0
    assert row["creep_m_s"] == 0.01
    assert row["contacts"] == 2
    assert row["true_peak_n"] == 5.0
    assert row["recovery_s"] == 2.5
    stuck = creeping.results(made_up(times, force), gap, towards, 0.3)
    assert stuck["recovery_s"] is None


def test_the_hand_is_in_the_way_of_the_arms_side_wherever_the_seed_puts_it():
    places = np.array([creeping.visit(seed).place for seed in range(100, 130)])
    # the robot's hand is 0.204 m wide and passes at x = 0.4 and z = 0.557; the fist's radius is 0.05 m
    assert np.all(np.abs(places[:, 0] - 0.4) < 0.05)
    assert np.all(np.abs(places[:, 2] - 0.557) < 0.05)
    assert np.all(places[:, 1] + 0.05 > -0.5 - 0.102)
    assert len(np.unique(places[:, 1])) == 30


def test_cells_are_all_modes_unless_the_run_names_some():
    named = [(c.profile, c.where["restrictions"]) for c in creeping.cells(Grid(("blind", "paper")))]
    assert named == [("blind", "off"), *(("paper", mode) for mode in ("off", "slack", "hard", "floor"))]
    assert len(creeping.cells(Grid(("paper",), ("hard",)))) == 1


def test_a_summary_of_any_rows_makes_a_table_that_fits(slack):
    row, _ = slack
    touched = row | {"contact": True, "contacts": 3, "recovery_s": None, "creep_m_s": row["creep_m_s"] + 0.02}
    part = creeping.summarise([row, touched])
    (cell,) = part["cells"]
    assert cell["contact_fraction"] == 0.5
    assert cell["contacts"] == 3
    assert cell["recovery_s"]["n"] == 1
    assert cell["course_m"] == row["course_m"]
    assert cell["creep_m_s"]["median"] == pytest.approx(row["creep_m_s"] + 0.01)
    (table,) = creeping.tables(part)
    assert width(table) <= 80
    assert table.rows[0][9:11] == ("50", "1.5")
