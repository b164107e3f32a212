"""Postures of a workspace, and the study that holds coverage against the simulation."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.coverage.figure import coverage_figure
from pretouch.coverage.measuring import Setting, coverage_of
from pretouch.coverage.params import CoverageParams
from pretouch.coverage.workspace import postures
from pretouch.errors import ExperimentError
from pretouch.experiments.cell import Cell, Context, Grid
from pretouch.experiments.coverage import study
from pretouch.experiments.coverage.comers import Coming
from pretouch.importing.ready import ever_apart
from pretouch.robot.self_distance import capsule_ends, kinematics_of, self_distances
from pretouch.sim.scene import SceneSpec, fixtures

ROOM = fixtures(SceneSpec())


def drawn(model, workspace, count=6):
    return postures(model, ROOM, workspace, count, np.random.default_rng(1))


def hands(model, q):
    return np.array([model.kinematics(row).position[model.ee] for row in q])


def test_the_hand_is_on_the_path_all_along_it(panda_model):
    hand = hands(panda_model, drawn(panda_model, "circle", 8))
    np.testing.assert_allclose(hand[:, 0], 0.5, atol=1e-5)
    np.testing.assert_allclose(np.hypot(hand[:, 1], hand[:, 2] - 0.25), 0.25, atol=1e-5)
    turn = np.sort(np.arctan2(hand[:, 1], hand[:, 2] - 0.25))
    assert np.diff(turn).max() < 2 * 2 * np.pi / 8
    both = hands(panda_model, drawn(panda_model, "paths", 6))
    assert np.sum(np.isclose(both[:, 0], 0.4, atol=1e-5)) == 3, "half of them on the line"


def test_a_box_and_the_whole_range_of_the_joints(panda_model):
    hand = hands(panda_model, drawn(panda_model, "0.5,0.2,0.4,0.3,-0.2,0.5"))
    assert np.all((hand > [0.3 - 1e-5, -0.2 - 1e-5, 0.4 - 1e-5]) & (hand < [0.5 + 1e-5, 0.2 + 1e-5, 0.5 + 1e-5]))
    q = drawn(panda_model, "joints")
    assert np.all((q >= panda_model.q_min) & (q <= panda_model.q_max))
    gaps = self_distances(panda_model, capsule_ends(panda_model, kinematics_of(panda_model, q)))
    assert gaps[:, ever_apart(panda_model)].min() > 0


@pytest.mark.parametrize(
    ("workspace", "count", "said"),
    [
        ("square", 4, "The workspace is 'square': give circle, line, paths, joints, or opposite corners"),
        ("0,0,0,1,1", 4, "or opposite corners"),
        ("2,0,0,3,1,1", 2, "reaches less than half of the box"),
        ("circle", 1, "The number of postures is 1: give at least 2"),
    ],
)
def test_a_workspace_that_is_none(panda_model, workspace, count, said):
    with pytest.raises(ExperimentError, match=said):
        drawn(panda_model, workspace, count)


def test_the_same_seed_gives_the_same_numbers_and_the_figure_can_be_drawn(panda_model, paper_skin):
    setting = Setting(panda_model, ROOM, CoverageParams(), "circle", 4, 1000, 400)
    (one, _), (other, _) = (coverage_of(setting.ways(), paper_skin) for _ in range(2))
    assert one.links == other.links
    ways = setting.ways(1)
    fresh, _ = coverage_of(ways, paper_skin)
    assert fresh.arm.ways != one.arm.ways
    figure = coverage_figure(ways, fresh, paper_skin, frozenset({"hand_left"}))
    assert f"{100 * fresh.arm.ways.value:.0f} % of the ways" in figure.get_suptitle()
    assert len(figure.axes) == 4


def test_cells_are_those_of_profiles_that_sense():
    cells = study.cells(Grid(("blind", "pretouch")))
    assert {cell.profile for cell in cells} == {"pretouch"}
    assert [(c.where["arm"], c.where["skin"]) for c in cells][:3] == [
        ("moving", "own"), ("moving", "suggested"), ("moving", "random")
    ]  # fmt: skip


def test_a_ball_is_seen_in_time_by_a_point_near_it_while_there_is_way_to_brake():
    params = CoverageParams()
    needed = params.braking_m + 0.016 * 0.8
    ball = np.array([1.0, 0.0, 0.5])
    coming = Coming(
        1, np.zeros(3), np.zeros(3), np.zeros(3), True, {10: (needed + 0.01, ball), 20: (needed - 0.01, ball)}
    )
    beside, off = ball + np.array([0.149, 0.0, 0.0]), ball + np.array([0.151, 0.0, 0.0])
    assert study.seen_in_time(coming, {10: np.array([off, beside])}, params)
    assert not study.seen_in_time(coming, {10: off[None]}, params), "more than 0.1 m from its surface"
    assert not study.seen_in_time(coming, {20: beside[None]}, params), "too late"
    assert not study.seen_in_time(coming, {10: np.zeros((0, 3)), 11: beside[None]}, params)


def test_numbers_and_table_of_the_study():
    params = CoverageParams()
    step = SimpleNamespace(stamp=0.01, obstacles=SimpleNamespace(point=np.zeros((1, 3))))
    seen = Coming(1, np.zeros(3), np.zeros(3), np.zeros(3), True, {10: (0.5, np.zeros(3))}, 0.2)
    blind = Coming(1, np.zeros(3), np.zeros(3), np.zeros(3), True, {10: (0.5, np.ones(3))}, -0.1)
    row = study.results([seen, blind], SimpleNamespace(steps=[step]), params)
    assert row == {"came": 2, "blind": 1, "foreseen_blind": 0, "agree": 1, "fast": 1, "towards_m_s": 0.1}
    where = {"experiment": "coverage", "arm": "moving", "skin": "own", "profile": "pretouch", "predicted": 0.6}
    part = study.summarise([where | {"seed": seed} | row for seed in (0, 1)])
    (cell,) = part["cells"]
    assert (cell["came"], cell["blind"], cell["predicted"]) == (4, 2, 0.6)
    # Clopper and Pearson of 2 in 4
    assert (cell["blind_low"], cell["blind_high"]) == (0.068, 0.932)
    (table,) = study.tables(part)
    assert table.rows[0][:4] == ("pretouch\nmoving", "own", "2/4", "50\n7-93")
    assert len(table.rows[0]) == len(table.header)


@pytest.mark.slow
def test_a_short_trial_agrees_with_what_was_foreseen(panda_model, paper_skin, monkeypatch):
    """The simulated range finders cast rays in MuJoCo; coverage knows nothing of them."""
    monkeypatch.setattr(study, "COUNT", 3)
    cell = Cell("coverage", "pretouch", {"arm": "standing", "skin": "suggested"})
    row, _ = study.trial(cell, 1000, Context(panda_model, paper_skin))
    assert row["came"] == 3
    assert row["agree"] == 3
    assert 0.6 < row["predicted"] < 0.8


@pytest.mark.slow
def test_units_put_anywhere_are_others_for_each_seed(panda_model, paper_skin):
    one, other = (study.skin_of("random", panda_model, paper_skin, seed) for seed in (1000, 1001))
    best = study.skin_of("suggested", panda_model, paper_skin, 1000)
    assert len(one) == len(best) == 7 + study.MORE
    assert one.ids[7:] != other.ids[7:]
    assert study.skin_of("own", panda_model, paper_skin, 1000) is paper_skin
