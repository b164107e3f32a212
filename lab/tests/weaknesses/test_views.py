import numpy as np
import pytest
from lab.tests.rows import made_up
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.perception.obstacles import placed_sensors
from pretouch.perception.scene_filter import expected_range, no_fixtures
from pretouch.profiles import profile
from pretouch.sim.scene import fixtures
from pretouch_lab.cell import Cell, Context, Grid
from pretouch_lab.weaknesses import views

UNFILTERED = "paper:perception.self_margin_m=none"


@pytest.fixture(scope="module")
def trials(context):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(views, "_DURATION_S", 12.0)
        where = {"scene": "circle", "restrictions": "slack"}
        return {name: views.trial(Cell(views.NAME, name, where), 160, context) for name in ("paper", UNFILTERED)}


def test_with_the_filter_an_empty_room_changes_nothing(trials, panda_model):
    row, record = trials["paper"]
    assert row["arm_fraction"] > 0.02
    assert row["obstacle_fraction"] < 0.001
    assert row["speed_scale"] == 1.0
    assert row["false_detections"] == 0
    assert row["contact"] is False
    assert_within_limits(record, panda_model)


def test_without_it_the_arm_slows_for_itself(trials):
    filtered, row = trials["paper"][0], trials[UNFILTERED][0]
    assert row["obstacle_fraction"] > 0.02
    assert row["speed_scale"] < 0.9
    assert row["travelled_m"] < 0.9 * filtered["travelled_m"]
    assert max(row["obstacle_force_positive_n"]) > 0.1
    worst = max(row["obstacle_fraction_of_units"].values())
    assert row["obstacle_fraction"] == pytest.approx(
        np.mean(list(row["obstacle_fraction_of_units"].values())), abs=1e-4
    )
    assert worst > 0.2


def test_readings_are_sorted_by_what_the_model_predicts(context, panda_model, paper_skin):
    q = panda_model.description.q_ready
    kin = panda_model.kinematics(q)
    poses = placed_sensors(paper_skin, kin)
    room = fixtures(views.scene("low"))
    arm = expected_range(kin, poses, paper_skin.cones, panda_model.capsules, no_fixtures())
    either = expected_range(kin, poses, paper_skin.cones, panda_model.capsules, room)
    shown = np.full(len(paper_skin), np.nan)
    sees_arm = int(np.flatnonzero(np.isfinite(arm))[0])
    sees_floor = int(np.flatnonzero(either < arm - 0.2)[0])
    nothing = next(k for k in range(len(paper_skin)) if k not in (sees_arm, sees_floor))
    shown[sees_arm], shown[sees_floor], shown[nothing] = arm[sees_arm] - 0.05, either[sees_floor] - 0.05, 0.05
    record = made_up([0.0], q=[q], range_distance=[shown])
    row = views.seen(record, context, room, profile("paper:perception.self_margin_m=0.06"))
    assert row["target_fraction"] == pytest.approx(3 / 7, abs=1e-5)
    assert row["arm_fraction"] == row["room_fraction"] == row["unpredicted_fraction"] == pytest.approx(1 / 7, abs=1e-5)
    assert row["obstacle_fraction"] == 0.0
    assert row["cut_fraction"] == pytest.approx(np.mean(either - 0.06 < 0.8), abs=1e-5)
    reach = np.sort(either)[2] - 0.06 + 0.001  # from the margin before the third view on
    far = views.seen(record, context, room, profile(f"paper:perception.self_margin_m=0.06:slow.d_max_m={reach}"))
    assert far["cut_fraction"] == pytest.approx(3 / 7, abs=1e-5)
    nearer = views.seen(record, context, room, profile("paper:perception.self_margin_m=0.04"))
    assert nearer["unpredicted_fraction"] == pytest.approx(3 / 7, abs=1e-5)


def test_the_unit_that_looks_down_sees_the_table_and_nothing_of_the_arm(context, panda_model):
    skin = views.skin("down", context)
    assert skin.ids == (*context.skin.ids, "hand_down")
    assert views.skin("low", context) is context.skin
    kin = panda_model.kinematics(panda_model.description.q_ready)
    poses, room = placed_sensors(skin, kin), fixtures(views.scene("down"))
    arm = expected_range(kin, poses, skin.cones, panda_model.capsules, no_fixtures())
    either = expected_range(kin, poses, skin.cones, panda_model.capsules, room)
    # the ready posture has its TCP 0.48688 m above the base, fingers down
    assert either[-1] == pytest.approx(0.48688 - 0.03, abs=1e-4)
    assert arm[-1] == np.inf


def test_an_id_that_is_taken_is_left_to_its_unit(context, panda_model):
    skin = views.skin("down", context)
    twice = views.skin("down", Context(panda_model, skin))
    assert twice.ids == (*skin.ids, "hand_down_2")
    assert views.skin("down", Context(panda_model, twice)).ids[-1] == "hand_down_3"


def test_a_unit_that_looks_down_needs_the_filter(context, panda_model, monkeypatch):
    monkeypatch.setattr(views, "_DURATION_S", 8.0)
    where = {"scene": "down", "restrictions": "slack"}
    row, record = views.trial(Cell(views.NAME, "paper", where), 160, context)
    other, _ = views.trial(Cell(views.NAME, UNFILTERED, where), 160, context)
    # the table is all that the eighth unit sees, at all times, from 0.07 m above it
    assert row["room_fraction"] == pytest.approx(1 / 8, abs=0.01)
    assert row["cut_fraction"] > 1 / 8
    assert row["obstacle_fraction"] < 0.001
    assert other["obstacle_fraction_of_units"]["hand_down"] > 0.95
    assert other["travelled_m"] < 0.5 * row["travelled_m"]
    assert_within_limits(record, panda_model)


def test_cells_are_each_scene_with_and_without_the_filter():
    found = [(c.where["scene"], c.profile, c.where["restrictions"]) for c in views.cells(Grid(("blind", "paper")))]
    assert found[:3] == [("circle", "blind", "off"), ("circle", "paper", "slack"), ("circle", UNFILTERED, "slack")]
    already = [c.profile for c in views.cells(Grid((UNFILTERED,)))]
    assert already == [UNFILTERED] * 4
    assert [scene for scene, _, _ in found[::3]] == ["circle", "line", "low", "down"]


def test_the_way_is_compared_with_blind_and_tables_fit(trials):
    paper, other = (trials[name][0] for name in ("paper", UNFILTERED))
    blind = paper | {"profile": "blind", "restrictions": "off", "travelled_m": 4.0}
    part = views.summarise([blind, paper | {"travelled_m": 3.0}, other])
    (ratio,) = [cell["way_fraction"]["median"] for cell in part["cells"] if cell["profile"] == "paper"]
    assert ratio == 0.75
    tables = views.tables(part)
    assert [len(table.rows) for table in tables] == [2, 2]
    assert all(width(table) <= 80 for table in tables)
    (alone,) = views.summarise([other])["cells"]
    assert alone["way_fraction"] is None
    assert alone["obstacle_force_positive_n"] == other["obstacle_force_positive_n"]


def test_rows_of_two_modes_or_profiles_are_told_apart(trials):
    paper, other = (trials[name][0] for name in ("paper", UNFILTERED))
    hard = {"restrictions": "hard", "profile": "paper:approach.rows=hard"}
    part = views.summarise([paper, other, paper | hard, paper | {"profile": "paper-0.5m"}])
    for table in views.tables(part):
        assert [row[1] for row in table.rows] == [
            "paper\nslack", "paper\nslack\nno filter", "paper\napproach.rows=\nhard\nhard", "paper-0.5m\nslack",
        ]  # fmt: skip
        assert width(table) <= 80
    (first, _) = views.tables(views.summarise([paper, other]))
    assert [row[1] for row in first.rows] == ["paper", "paper\nno filter"]
