import numpy as np
import pytest
from tests.experiments.limits import assert_within_limits
from tests.experiments.rows import made_up
from tests.experiments.width import width

from pretouch.experiments.cell import Cell, Grid
from pretouch.experiments.weaknesses import views
from pretouch.perception.obstacles import sensor_poses
from pretouch.perception.scene_filter import expected_range, no_fixtures
from pretouch.sim.scene import fixtures

UNFILTERED = "paper:perception.filter_views=no"


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
    poses = sensor_poses(paper_skin, kin)
    room = fixtures(views.scene("table"))
    arm = expected_range(kin, *poses, paper_skin.link, panda_model.capsules, no_fixtures())
    either = expected_range(kin, *poses, paper_skin.link, panda_model.capsules, room)
    shown = np.full(len(paper_skin), np.nan)
    sees_arm = int(np.flatnonzero(np.isfinite(arm))[0])
    sees_floor = int(np.flatnonzero(either < arm - 0.2)[0])
    nothing = next(k for k in range(len(paper_skin)) if k not in (sees_arm, sees_floor))
    shown[sees_arm], shown[sees_floor], shown[nothing] = arm[sees_arm] - 0.05, either[sees_floor] - 0.05, 0.05
    record = made_up([0.0], q=[q], range_distance=[shown])
    row = views.seen(record, context, room, 0.06)
    assert row["target_fraction"] == pytest.approx(3 / 7, abs=1e-5)
    assert row["arm_fraction"] == row["room_fraction"] == row["unpredicted_fraction"] == pytest.approx(1 / 7, abs=1e-5)
    assert row["obstacle_fraction"] == 0.0
    nearer = views.seen(record, context, room, 0.04)
    assert nearer["unpredicted_fraction"] == pytest.approx(3 / 7, abs=1e-5)


def test_cells_are_each_scene_with_and_without_the_filter():
    found = [(c.where["scene"], c.profile, c.where["restrictions"]) for c in views.cells(Grid(("blind", "paper")))]
    assert found[:3] == [("circle", "blind", "off"), ("circle", "paper", "slack"), ("circle", UNFILTERED, "slack")]
    assert [scene for scene, _, _ in found[::3]] == ["circle", "line", "table", "low"]


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
