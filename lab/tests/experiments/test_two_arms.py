"""The study of two arms over one table: its cells and numbers by hand, and a short closed loop."""

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch_lab.experiments import two_arms
from pretouch_lab.experiments.two_arms import BACK, Reaches, play, reaches, way


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
    sides, peaks = play(context, profile("pretouch"), knows, 1, 9.0)
    row = two_arms.results(sides, peaks, 0.3 * 9.0)
    assert row["done"] > 0.0
    near = [(step.obstacles.unit < len(context.skin)).any() for side in sides for step in side.steps]
    assert (np.mean(near) > 0.5) == (knows == "seen"), "else units see the person alone"
    if knows == "blind":
        assert row["arms_touched"]
        assert row["arms_peak_n"] > 20.0
    if knows == "told":
        assert not row["arms_touched"]
    told = {"profile": "pretouch", "restrictions": "braking", "knows": knows}
    assert "Two arms" in str(two_arms.tables([told | row])[0])
