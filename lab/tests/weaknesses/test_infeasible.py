from dataclasses import replace

import numpy as np
import pytest
from lab.tests.width import width

from pretouch.perception.closest import closest_points
from pretouch.profiles import profile
from pretouch.types import Obstacles
from pretouch_lab.cell import Cell, Grid
from pretouch_lab.weaknesses import infeasible

PAPER = profile("paper")
UP = np.array([0.0, 0.0, 1.0])


def beside_link1(direction):
    """Return a point 0.05 m beside a point of link 1 that is 0.05 m off joint 1, the only one that moves it."""
    point, direction = np.array([[0.05, 0.0, 0.3]]), np.array([direction])
    return Obstacles(
        np.zeros(1, np.int64), point + 0.05 * direction, np.ones(1), point, np.array([2]), direction,
        np.array([0.05]), np.zeros(1),
    )  # fmt: skip


def answers(model, direction):
    assert model.links[2] == "panda_link1"
    return infeasible.answers(model, PAPER, model.description.q_ready, beside_link1(direction), UP)


def test_no_joint_moves_link_1_away_along_its_radius(panda_model):
    found = answers(panda_model, [1.0, 0.0, 0.0])
    assert found.never
    assert found.at_once
    assert found.fastest_m_s == pytest.approx(0.0, abs=1e-9)
    # eqs. 5 and 7 at half of d_crit: V_max / 2 - V_max = -0.02 m/s, and nothing of it can be met
    assert found.slack_m_s == pytest.approx(0.02, abs=1e-6)


def test_across_it_joint_1_does_but_not_at_once(panda_model):
    found = answers(panda_model, [0.0, 1.0, 0.0])
    assert not found.never
    assert found.at_once
    assert found.fastest_m_s == pytest.approx(0.05 * 2.175)
    # from rest 15 rad/s^2 give 0.15 rad/s in 10 ms, so 0.0075 m/s of the 0.02
    assert found.slack_at_once_m_s == pytest.approx(0.0125, abs=1e-6)
    assert found.slack_m_s < 0.001


def test_points_lie_outside_the_body_and_near_it(panda_model):
    rng = np.random.default_rng(100)
    links = set()
    for _ in range(200):
        kin = panda_model.kinematics(rng.uniform(panda_model.q_min, panda_model.q_max))
        point = infeasible.near_body(panda_model, kin, rng)
        near = closest_points(kin, panda_model.body, np.zeros(3), np.zeros(1, np.int64), point[None], UP[None])
        assert 0.0 <= near.body_distance[0] <= 0.1 + 1e-12
        links.add(int(near.link[0]))
    assert len(links) == 8


def test_a_batch_is_counted_in_all_and_by_link():
    one = infeasible.Answers(1, 0.5, True, True, 0.03, 0.04)
    found = [one, replace(one, never=False, slack_m_s=0.01), replace(one, link=2, never=False, at_once=False)]
    row = infeasible.results(found, ("world", "first", "second"))
    assert (row["postures"], row["never"], row["at_once"]) == (3, 1, 2)
    assert row["slack_median_m_s"] == 0.03
    assert row["slack_largest_m_s"] == 0.03
    assert row["by_link"] == {
        "first": {"postures": 2, "never": 1, "at_once": 2, "fastest_m_s": 0.5},
        "second": {"postures": 1, "never": 0, "at_once": 0, "fastest_m_s": 0.5},
    }


@pytest.fixture(scope="module")
def rows(context):
    cells = infeasible.cells(Grid(("blind", "paper")))
    assert [cell.where["points"] for cell in cells] == [1.0, 2.0, 4.0, 8.0]
    assert {cell.profile for cell in cells} == {"paper"}
    return [infeasible.trial(cell, seed, context)[0] for seed in (170, 171) for cell in cells]


def test_more_points_are_harder_to_meet_and_harder_at_once(rows):
    for batch in (rows[:4], rows[4:]):
        never = [row["never"] for row in batch]
        assert never == sorted(never)
        assert never[-1] > 100
        assert all(row["at_once"] >= row["never"] for row in batch)


def test_the_same_seed_gives_the_same_batch(context, rows):
    again, record = infeasible.trial(Cell(infeasible.NAME, "paper", {"points": 1.0}), 170, context)
    assert record is None
    assert again == rows[0]


def test_batches_add_up_and_tables_fit(rows):
    part = infeasible.summarise(rows)
    assert part["cells"][0]["postures"] == 500
    assert part["cells"][3]["never"] == rows[3]["never"] + rows[7]["never"]
    assert part["cells"][3]["slack_largest_m_s"] == max(rows[3]["slack_largest_m_s"], rows[7]["slack_largest_m_s"])
    assert sum(link["postures"] for link in part["links"]) == 500
    tables = infeasible.tables(part)
    assert all(width(table) <= 80 for table in tables)
    assert len(infeasible.tables(infeasible.summarise(rows[1:4]))) == 1
