"""The study that holds coverage against the simulation."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.coverage.params import CoverageParams
from pretouch_lab.experiments import coverage
from pretouch_lab.experiments.coverage import ApproachingObstacle


def coming(near):
    return ApproachingObstacle(1, *np.zeros((2, 3)), True, near)


def test_a_ball_is_seen_in_time_by_a_point_near_it_while_there_is_way_to_brake():
    params = CoverageParams()
    needed = params.braking_m + 0.016 * 0.8
    ball = np.array([1.0, 0.0, 0.5])
    obstacle = coming({10: (needed + 0.01, ball), 20: (needed - 0.01, ball)})
    beside, off = ball + np.array([0.149, 0.0, 0.0]), ball + np.array([0.151, 0.0, 0.0])
    assert coverage.seen_in_time(obstacle, {10: np.array([off, beside])}, params)
    assert not coverage.seen_in_time(obstacle, {10: off[None]}, params), "more than 0.1 m from its surface"
    assert not coverage.seen_in_time(obstacle, {20: beside[None]}, params), "too late"
    assert not coverage.seen_in_time(obstacle, {10: np.zeros((0, 3)), 11: beside[None]}, params)


def test_numbers_and_table_of_the_study():
    params = CoverageParams()
    step = SimpleNamespace(stamp=0.01, obstacles=SimpleNamespace(point=np.zeros((1, 3))))
    seen, blind = coming({10: (0.5, np.zeros(3))}), coming({10: (0.5, np.ones(3))})
    row = coverage.results([seen, blind], SimpleNamespace(steps=[step]), params)
    assert row == {"came": 2, "blind": 1, "foreseen_blind": 0}
    where = {"arm": "moving", "skin": "own", "profile": "pretouch"}
    (table,) = coverage.tables([where | {"seed": seed} | row for seed in (0, 1)])
    # Clopper and Pearson of 2 in 4
    assert table.rows[0] == ("pretouch\nmoving", "own", "2/4", "50\n7-93", "0")


@pytest.mark.slow
def test_a_short_trial_agrees_with_what_was_foreseen(context, monkeypatch):
    """The simulated range finders cast rays in MuJoCo; coverage knows nothing of them."""
    monkeypatch.setattr(coverage, "COUNT", 3)
    cell = {"arm": "standing", "skin": "suggested", "profile": "pretouch"}
    row, _ = coverage.trial(cell, 1000, context)
    assert row["came"] == 3
    assert row["blind"] == row["foreseen_blind"]


@pytest.mark.slow
def test_units_put_anywhere_are_others_for_each_seed(panda_model, paper_skin):
    one, other = (coverage.skin_of("random", panda_model, paper_skin, seed) for seed in (1000, 1001))
    best = coverage.skin_of("suggested", panda_model, paper_skin, 1000)
    assert len(one) == len(best) == 7 + coverage.MORE
    assert one.ids[7:] != other.ids[7:]
    assert coverage.skin_of("own", panda_model, paper_skin, 1000) is paper_skin
