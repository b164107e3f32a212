"""Arms with the flaws of real ones in the detection benchmark."""

from collections import Counter
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from lab.tests.bench.wandering import WanderingController

from pretouch_lab.bench import hard
from pretouch_lab.bench.contenders import DETECTORS
from pretouch_lab.bench.detection import plays
from pretouch_lab.bench.detection_results import HARD, UNTOLD, arms_of, hard_rows
from pretouch_lab.bench.hard import hard_stream
from pretouch_lab.bench.motions import motion_of
from pretouch_lab.bench.scenes import ArmCell, model, scenario
from pretouch_lab.bench.streams import record


def test_each_hard_motion_is_long_enough_to_show_that_its_goal_is_reached():
    seconds = Counter()
    for arm, _ in plays("published", quick=False):
        if arm["family"] == "hard" and arm["near"] != "touched":
            seconds[arm["path"]] += arm["counted_s"]
    del seconds[UNTOLD]
    goal = scenario("hard")["goal"]
    assert len(seconds) == 6
    assert 3.689 / (min(seconds.values()) / 3600) <= goal["in_any_motion_per_hour"]
    assert 3.689 / (sum(seconds.values()) / 3600) <= goal["false_alarms_per_hour"]


@pytest.mark.parametrize("name", list(scenario("hard")["motion"]))
def test_a_hard_motion_is_within_the_limits_and_as_fast_as_it_says(name):
    arm, motion, until = model(), motion_of(name, 1000, 120.0), 120.0
    times = np.arange(0.0, until, 0.01)
    q, qd = (np.array(part) for part in zip(*(motion.at(time) for time in times), strict=True))
    assert (q >= arm.q_min).all()
    assert (q <= arm.q_max).all()
    np.testing.assert_allclose(np.gradient(q, times, axis=0)[1:-1], qd[1:-1], atol=0.1)
    assert 0.0 < np.abs(qd).max() <= scenario("hard")["motion"][name]["speed_rad_s"][1] + 0.01
    hand = np.array([arm.kinematics(way).position[arm.ee] for way in q[::5]])
    if motion.loads:
        fastest = np.linalg.norm(np.diff(hand, axis=0), axis=1).max() / 0.05
        assert 0.7 < fastest < 1.1
        assert 0.0 < motion.loads[0][0] < motion.loads[1][0]
        assert 0.2 <= motion.loads[0][1] <= 1.0
        assert motion.loads[1][1] == 0.0
    else:
        assert hand[:, 2].min() > 0.0


@pytest.mark.slow
def test_a_hard_arm_moves_and_sees_without_a_controller_as_with_one(monkeypatch):
    arm = ArmCell("hard", path="pick-and-place", near="standing", counted_s=1.0)
    (made, _), (alone, _) = hard_stream(arm, 1003), hard_stream(replace(arm, near="nothing"), 1003)
    assert made.stamp[-1] == pytest.approx(61.0, abs=0.05)

    def by_controller(what, prepare, command):
        monkeypatch.setattr("pretouch_lab.trial.Controller", partial(WanderingController, command.__self__))
        return record(what, prepare)

    monkeypatch.setattr(hard, "record_moved", by_controller)
    controlled, _ = hard_stream(arm, 1003)
    assert made.count.max() > 0
    np.testing.assert_array_equal(made.watched, controlled.watched)
    np.testing.assert_array_equal(made.count, controlled.count)
    ours, theirs = (one.robot | one.obstacles._asdict() for one in (made, controlled))
    for name, numbers in theirs.items():
        np.testing.assert_array_equal(ours[name], numbers)
    for name, numbers in alone.robot.items():  # nobody near, no units
        np.testing.assert_array_equal(numbers, made.robot[name])


def test_rows_are_by_motion_and_loads_that_nobody_announced_are_apart():
    def free(motion, near, alarms):
        arm = {"family": "hard", "path": motion, "near": near, "kind": "nominal", "speed_m_s": 0.0}
        return arm | {"contender": "pretouch", "hours": 1.0, "alarms": alarms}

    touch = {"seen": True, "delay_s": 0.03, "towards": False, "detectable": True, "force_n": 20.0, "duration_s": 0.3}
    touch |= {"link": "hand"}
    missed = touch | {"delay_s": None, "towards": None}
    hidden = missed | {"detectable": False}
    touched = free("random", "touched", 0) | {"contacts": [touch, missed, hidden]}
    rows = [free("random", "nothing", 1), free("jogging", "standing", 2), free(UNTOLD, "nothing", 40), touched]
    found = {row["scenario"]: row for row in hard_rows(arms_of(rows, "hard"), DETECTORS[-1:])}
    assert found[HARD]["false_alarms"] == 3
    assert found["hard: all, nobody near"]["false_alarms"] == 1
    assert found["hard: untold-load"]["false_alarms_per_hour"] == 40.0
    assert (found["hard, touched: all"]["missed"], found["hard, touched: all"]["contacts"]) == (1, 2)
    assert found["hard, touched: random"]["median_delay_s"] == 0.03
