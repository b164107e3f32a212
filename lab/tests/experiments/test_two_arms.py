"""The study of two arms over one table: its cells and numbers by hand, and a short closed loop."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch.types import MovingFixtures, no_obstacles
from pretouch_lab.experiments import two_arms
from pretouch_lab.experiments.two_arms import BACK, Reaches, play, reaches, way


def test_touches_are_counted_once_while_they_chatter():
    time = np.arange(0.0, 2.0, 0.001)
    force = np.zeros(len(time))
    force[100:150] = force[200:210] = 5.0
    assert two_arms.touches(time, force) == 1  # 50 ms in between
    force[900:905] = 2.0
    assert two_arms.touches(time, force) == 2
    assert two_arms.touches(time, np.full(len(time), 0.9)) == 0


def test_a_point_shows_the_other_arm_if_no_person_is_nearer():
    rod = MovingFixtures(
        0.0, np.array([[0.5, 0.0, 0.0]]), np.array([[0.5, 0.0, 1.0]]), np.array([0.05]), np.zeros((1, 3)),
        np.zeros((1, 3)),
    )  # fmt: skip

    def step(unit: int, *point: float) -> SimpleNamespace:
        return SimpleNamespace(obstacles=no_obstacles()._replace(unit=np.array([unit]), point=np.array([point])))

    # on its surface, 0.2 m away from it, told by no unit, on it but nearer to the person, and none
    steps = [step(0, 0.45, 0.0, 0.5), step(0, 0.25, 0.0, 0.5), step(1, 0.45, 0.0, 0.5), step(0, 0.45, 0.0, 0.2)]
    steps.append(SimpleNamespace(obstacles=no_obstacles()))
    side = SimpleNamespace(controller=SimpleNamespace(skin=[None]), steps=steps, across=5 * [rod])
    hand = np.tile([0.41, 0.0, 0.2], (5, 1))
    hand[:3] = 3.0
    assert two_arms.shows_other(side, hand) == pytest.approx(1 / 5)


def test_both_ways_begin_on_one_side_and_cross_the_middle():
    first, second = way(1.0, 0.0), way(-1.0, 0.25)
    assert first.length == second.length == pytest.approx(2 * np.linalg.norm([0.23, 0.35, 0.1]))
    home, reach = (BACK @ [*second.point(s), 1.0] for s in (0.875 * second.length, 0.375 * second.length))
    assert home[:3] == pytest.approx([0.75, 0.35, 0.35])
    assert reach[:3] == pytest.approx([0.52, 0.0, 0.25])
    assert first.point(first.length / 2) == pytest.approx([0.58, 0.0, 0.25])


def test_a_person_reaches_stays_and_withdraws():
    person = Reaches(5.0, np.array([[0.5, 0.0, 0.3], [0.6, 0.0, 0.3]]))
    goals = [person.goal(t, np.zeros(3), None).position[0] for t in (4.9, 5.1, 8.0, 8.2, 12.1, 19.1)]
    assert goals == [0.55, 0.5, 0.5, 0.55, 0.6, 0.55]
    drawn = reaches(np.random.default_rng(0), 40.0)
    assert len(drawn.aims) == 6
    assert 5.0 <= drawn.begin <= 8.0


@pytest.mark.slow
@pytest.mark.parametrize("knows", ["blind", "seen", "told"])
def test_a_short_trial(context, knows):
    played = play(context, profile("pretouch"), knows, 1, 9.0)
    row = two_arms.results(played, 0.3 * 9.0)
    assert len(played.felt.time) == 9000
    assert row["done"] > 0.0
    if knows == "seen":
        assert row["taken_fraction"] > 0.5
    else:
        assert row["taken_fraction"] < 0.05
    if knows == "blind":
        assert row["arms"] > 0
        assert row["arms_peak_n"] > 20.0
    if knows == "told":
        assert row["arms"] == 0
    told = {"profile": "pretouch", "restrictions": "braking", "knows": knows}
    assert "Two arms" in str(two_arms.tables([told | row])[0])
