from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.modes import Event
from pretouch.sim.plant import Touch
from pretouch.types import Mode
from pretouch_lab.bench import avoidance_measures as measures
from pretouch_lab.bench.avoidance_measures import livelocks, stuck_for
from pretouch_lab.bench.obstacle import Ball
from pretouch_lab.trial import Record


def step(i, **changed):
    """A control step at 100 Hz, in which nothing happens."""
    usual = dict.fromkeys(("ee_position", "path_position", "force", "reaction_velocity"), np.zeros(3))
    usual |= dict.fromkeys(("q", "command"), np.zeros(7))
    usual |= {"stamp": 0.01 * i, "mode": Mode.TRACK, "reason": "As requested.", "path_phase": 0.0, "contact": None}
    return SimpleNamespace(**usual | changed)


def record(steps, force=(), touches=(), hand=None):
    """What is left of the steps; `force` gives (begin, end, newtons along y) [s]."""
    time = 0.001 * np.arange(1, 10 * len(steps) + 1)
    true = np.zeros((len(time), 3))
    for begin, end, size in force:
        true[(time > begin) & (time <= end), 1] = size
    hand = np.full((len(steps), 3), np.nan) if hand is None else hand
    return Record(list(steps), time, true, list(touches), hand)


def towards(_step):
    return np.array([0.0, -1.0, 0.0])


def test_clamping_is_the_largest_mean_over_half_a_second_of_unbroken_contact():
    time = 0.001 * np.arange(1, 3001)
    force = np.zeros(3000)
    force[100:500] = 90.0  # an impact of 0.4 s
    force[1000:1600] = 20.0
    force[2000:2499] = 50.0  # one sample short
    assert measures.clamping(time, force) == pytest.approx(20.0)
    assert measures.clamping(time[:400], force[:400]) == 0.0
    assert measures.clamping(time[:0], force[:0]) == 0.0


def test_contact_by_numbers_with_the_persons_own_speed_and_none_without():
    steps = [step(i, force=np.array([0.0, 12.0 if i > 100 else 3.0, 0.0])) for i in range(200)]
    standing = record(steps, [(1.0, 1.01, 40.0)], [Touch(1.001, 8, np.array([0.0, -0.3, 0.0]))])
    row = measures.contact(standing, np.arange(200) >= 40, towards)
    assert row["first_contact_s"] == pytest.approx(0.601)  # near from 0.4 s on, touched at 1.001 s
    assert row["impact_speed_m_s"] == pytest.approx(0.3)
    assert row["peak_estimate_n"] == pytest.approx(12.0)
    assert row["true_peak_20ms_n"] == pytest.approx(20.0)
    assert row["clamping_force_n"] == 0.0
    hand = np.array([[0.0, -0.5 + 0.002 * i, 0.0] for i in range(200)])  # 0.2 m/s towards the arm
    coming = record(steps, [(1.0, 1.1, 5.0)], [Touch(1.001, 8, np.zeros(3))], hand)
    assert measures.contact(coming, np.ones(200, bool), towards)["impact_speed_m_s"] == pytest.approx(0.2)
    row = measures.contact(record([step(i) for i in range(50)]), np.ones(50, bool), towards)
    assert not row["contact"]
    assert row["first_contact_s"] is row["impact_speed_m_s"] is row["peak_estimate_n"] is None
    assert row["true_peak_20ms_n"] == 0.0


def test_the_cycle_time_is_that_of_the_second_turn():
    # the first turn of 1 m takes 2 s, the second 4 s
    phase = [0.005 * i if i <= 200 else 1.0 + 0.0025 * (i - 200) for i in range(601)]
    off = np.array([0.0, 0.03, 0.0])
    steps = [step(i, path_phase=p, path_position=off) for i, p in enumerate(phase)]
    row = measures.tracking(steps, 1.0)
    assert row["cycle_time_s"] == pytest.approx(4.0)
    assert row["speed_m_s"] == pytest.approx(2.0 / 6.0, abs=1e-4)
    assert row["tracking_rms_m"] == pytest.approx(0.03)
    assert measures.tracking(steps[:500], 1.0)["cycle_time_s"] is None
    assert measures.tracking(steps, 0.0) == {"tracking_rms_m": 0.03, "speed_m_s": None, "cycle_time_s": None}


def test_jerk_and_holds_by_numbers():
    # a command that grows by 0, 1, 0, 1, ... mrad/s in a step: |jerk| = 0.001 / 0.01^2 = 10 rad/s^3
    speed = np.cumsum(np.arange(300) % 2) * 0.001
    steps = [step(i, command=np.full(7, v)) for i, v in enumerate(speed)]
    assert measures.jerk(steps, 0.01) == pytest.approx(10.0)
    assert measures.jerk(steps[:2], 0.01) == 0.0
    modes = [Mode.TRACK] * 5 + [Mode.HOLD] * 20 + [Mode.TRACK] * 5 + [Mode.HOLD] * 3
    steps = [step(i, mode=m, event=Event.SKIN_SILENT) for i, m in enumerate(modes)]
    held = {"holds": 2, "held_s": pytest.approx(0.23), "hold_events": {"skin_silent": 2}}
    assert measures.holds(steps, 0.01) == held


def test_reactions_are_judged_by_the_true_force_before_them():
    # pushed towards +y from 1.0 to 1.2 s: an answer with it, an echo against it, and one for nothing
    steps = [step(i) for i in range(900)]
    for i, speed in ((110, 0.2), (250, -0.2), (800, -0.2)):
        steps[i].contact, steps[i].mode = object(), Mode.REACT
        # torn loose one step later
        steps[i + 1].mode, steps[i + 1].reaction_velocity = Mode.REACT, np.array([0.0, speed, 0.0])
    row = measures.reactions(record(steps, [(1.0, 1.2, 15.0)]))
    assert row == {"reactions": 3, "false_reactions": 2, "towards_person": 1}


def test_a_livelock_is_no_way_for_long_with_nothing_in_the_way():
    phase = np.array([0.0, 1.0, 1.0, 1.0, 1.0, 2.0, 3.0])
    clear = np.ones(7, bool)
    np.testing.assert_array_equal(stuck_for(phase, clear, 3, 0.5), [False, True, True, True, True, False, False])
    clear[2] = False
    assert not stuck_for(phase, clear, 3, 0.5).any()
    path = SimpleNamespace(point=lambda s: np.array([0.0, s, 0.0]))
    setting = SimpleNamespace(setup=SimpleNamespace(path=path), shape=lambda hand: Ball(hand, 0.05))
    limits = {"advance_m": 0.02, "within_s": 1.0, "clear_m": 0.2, "ahead_m": 0.3}
    steps = [step(i) for i in range(400)]
    far, near = np.tile([0.0, -1.0, 0.0], (400, 1)), np.tile([0.0, 0.4, 0.0], (400, 1))
    assert livelocks(record(steps, hand=far), setting, limits) == {"livelocks": 1, "livelock_s": pytest.approx(4.0)}
    assert livelocks(record(steps, hand=near), setting, limits) == {"livelocks": 0, "livelock_s": 0.0}
    assert livelocks(record(steps, hand=far), setting, None) == {"livelocks": None, "livelock_s": None}
