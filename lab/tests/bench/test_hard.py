"""Arms as unkind as real ones in the detection benchmark."""

import numpy as np
import pytest
from lab.tests.bench.test_localization import within_limits

from pretouch_lab.bench.contenders import DETECTORS
from pretouch_lab.bench.detection_results import HARD, UNTOLD, arms_of, hard_rows
from pretouch_lab.bench.hard import HardCell, hard_cells, hard_stream
from pretouch_lab.bench.motions import motion_of
from pretouch_lab.bench.scenes import model, scenario


def test_hard_motion_lasts_ten_hours_and_more():
    cells = hard_cells("published", quick=False)
    free = [cell for cell in cells if cell.near != "touched" and cell.motion != UNTOLD]
    assert sum(cell.counted_s for cell in free) / 3600 > 10.0
    assert len({cell.motion for cell in free}) == 6


@pytest.mark.parametrize("name", list(scenario("hard")["motion"]))
def test_a_hard_motion_is_within_the_limits_and_as_fast_as_it_says(name):
    arm, motion, until = model(), motion_of(name, 1000, 120.0), 120.0
    q, qd = within_limits(motion.course, until)
    assert 0.0 < np.abs(qd).max() <= scenario("hard")["motion"][name]["speed_rad_s"][1] + 0.01
    hand = np.array([arm.kinematics(way).position[arm.ee] for way in q[::5]])
    if motion.loads:
        fastest = np.linalg.norm(np.diff(hand, axis=0), axis=1).max() / 0.05
        assert 0.7 < fastest < 1.1
        assert motion.load(0.0) == 0.0
        assert 0.2 <= motion.load(motion.loads[0][0]) <= 1.0
        assert motion.load(motion.loads[1][0]) == 0.0
    else:
        assert hand[:, 2].min() > 0.0


@pytest.mark.slow
def test_a_hard_stream_has_what_the_arm_carried_and_somebody_stands_beside_it():
    kept = hard_stream(HardCell("pick-and-place", "standing", 1003, 1.0), True)
    assert kept.stamp[-1] == pytest.approx(61.0, abs=0.05)
    assert set(kept.truth["load"] > 0.0) == {True, False}
    assert kept.count.max() > 0


def test_rows_are_by_motion_and_loads_that_nobody_announced_are_apart():
    def free(motion, near, alarms):
        named = {"family": "hard", "contender": "pretouch", "motion": motion, "near": near}
        return named | {"hours": 1.0, "alarms": alarms}

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
