"""The study of two arms over one table: its cells and numbers by hand, and a short closed loop."""

import numpy as np
import pytest

from pretouch.profiles import profile
from pretouch_lab.experiments import two_arms
from pretouch_lab.experiments.two_arms import BACK, play, reaches, way


def test_both_ways_begin_on_one_side_and_cross_the_middle():
    first, second = way(1.0, 0.0), way(-1.0, 0.25)
    assert first.length == second.length == pytest.approx(2 * np.linalg.norm([0.23, 0.35, 0.1]))
    home, reach = (BACK @ [*second.point(s), 1.0] for s in (0.875 * second.length, 0.375 * second.length))
    assert home[:3] == pytest.approx([0.75, 0.35, 0.35])
    assert reach[:3] == pytest.approx([0.52, 0.0, 0.25])
    assert first.point(first.length / 2) == pytest.approx([0.58, 0.0, 0.25])


def test_a_person_reaches_stays_and_withdraws():
    drawn = reaches(np.random.default_rng(0), 40.0)
    begin, rests = drawn.times[1], [0.55, -0.8, 0.45]
    assert 5.0 <= begin <= 8.0
    assert len(drawn.times) == 6 * 4
    after = (-0.1, 0.1, 3.0, 3.2, 7.1, 11.0)
    goals = [drawn.goal(begin + t, np.zeros(3), None).position.tolist() for t in after]
    assert goals[0] == goals[3] == goals[5] == rests
    assert goals[1] == goals[2] != goals[4]
    assert np.abs(np.subtract([goals[1], goals[4]], [0.55, 0.0, 0.3])).max() <= 0.08


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
