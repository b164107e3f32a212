import json
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from lab.tests.width import width
from tests.limits import assert_within_limits

from pretouch.sim.pushes import Push
from pretouch.types import Mode
from pretouch_lab.cell import Cell
from pretouch_lab.trial import Record
from pretouch_lab.weaknesses import release

pytestmark = pytest.mark.slow

Y = np.array([0.0, 1.0, 0.0])


def step(stamp, y, mean=0.0, reaction=0.0, begins=False, force=0.0):
    """A control step at y [m], with the window's mean [N] and a reaction velocity [m/s] along y."""
    return SimpleNamespace(
        stamp=stamp,
        ee_position=y * Y,
        thresholds=SimpleNamespace(mean=mean * Y),
        mode=Mode.REACT if reaction or begins else Mode.TRACK,
        reaction_velocity=reaction * Y,
        contact="contact" if begins else None,
        force=force * Y,
    )


def record(steps):
    """Pushed with 20 N along y from 1 s to 2 s, but for the second half of that, and after 2.1 s."""
    time = np.linspace(0.0, 6.0, 6001)
    force = np.where(((time >= 1.0) & (time <= 1.5)) | (time > 2.1), 20.0, 0.0)[:, None] * Y
    return Record(steps, time, force, [], np.full((len(steps), 3), np.nan))


PERSON = SimpleNamespace(pushes=(Push(0.0, Y, 20.0, 1.0),), contacts=[(1.0, 2.0)])
STEPS = [
    step(1.0, 0.00),
    step(1.1, 0.02, mean=3.0, reaction=0.3, begins=True),
    step(2.0, 0.05, mean=12.0, force=np.nan),
    step(2.1, 0.03, mean=11.0),  # back to the path at 0.2 m/s
    step(2.2, 0.03, mean=9.0, reaction=-0.3, begins=True),
    step(2.3, 0.015, mean=4.0, reaction=-0.2),  # on towards the person at 0.15 m/s
    step(5.1, -9.0, reaction=-0.3, begins=True),  # too late to count
]


def push_row(**changes):
    return {
        "push_n": 20.0, "watched": True, "touching_fraction": 1.0, "estimated_fraction": 1.0, "detected": True,
        "reactions": 2, "against_while_held": 0, "against_after_release": 0, "mean_peak_n": 10.0,
        "speed_towards_m_s": 0.1, "reaction_speed_towards_m_s": None,
    } | changes  # fmt: skip


def test_a_release_answered_towards_the_person_is_told_from_the_answer_to_the_push():
    (push,) = release.judged(record(STEPS), PERSON)
    parts = {"touching_fraction": pytest.approx(0.5, abs=2e-3), "estimated_fraction": pytest.approx(2 / 3, abs=1e-3)}
    speeds = {"speed_towards_m_s": pytest.approx(0.2), "reaction_speed_towards_m_s": pytest.approx(0.15)}
    assert push == push_row(**parts, **speeds, against_after_release=1, mean_peak_n=12.0)


def test_a_reaction_against_the_push_while_it_is_held_is_no_answer_to_it():
    steps = [step(1.0, 0.0), step(1.2, -0.02, mean=-5.0, reaction=-0.3, begins=True), step(2.1, -0.02)]
    (push,) = release.judged(record(steps), PERSON)
    assert push["detected"] is False
    assert push["watched"] is False  # the trial is over before the 3 s are
    assert (push["against_while_held"], push["against_after_release"]) == (1, 0)
    assert push["mean_peak_n"] == 5.0
    assert push["reaction_speed_towards_m_s"] == pytest.approx(0.1)


@pytest.mark.parametrize(("later", "detected"), [(0.3, True), (-0.3, False), (0.0, False)])
def test_a_reaction_from_standstill_is_judged_by_its_first_motion(later, detected):
    steps = [step(1.0, 0.0), step(1.1, 0.0, begins=True), step(1.2, 0.0, reaction=later), step(5.1, 0.0)]
    (push,) = release.judged(record(steps), PERSON)
    assert (push["detected"], push["reactions"], push["against_while_held"]) == (detected, 1, int(later < 0))


def test_a_push_that_never_touched_is_left_out_and_the_next_touch_ends_the_watch():
    pushes = (Push(0.0, Y, 20.0, 1.0),) * 4  # the last was not released before the trial was over
    person = SimpleNamespace(pushes=pushes, contacts=[(1.0, 2.0), None, (2.15, 2.25)])
    first, second = release.judged(record(STEPS), person)
    assert first["reactions"] == 1
    assert (second["reactions"], second["detected"]) == (2, False)
    assert release.judged(record(STEPS), SimpleNamespace(pushes=pushes, contacts=[None])) == []
    assert release.judged(record(STEPS), SimpleNamespace(pushes=pushes, contacts=[])) == []


def test_an_arm_is_stuck_that_holds_without_a_force_estimate():
    none, some = np.full(3, np.nan), np.zeros(3)
    modes = [(Mode.HOLD, none), (Mode.HOLD, some), (Mode.REACT, none)]
    assert [release.stuck(SimpleNamespace(mode=mode, force=force)) for mode, force in modes] == [True, False, False]


def test_pushes_are_against_one_face_and_leave_time_to_watch_each():
    fronts = set()
    for seed in range(12):
        planned = release.pushes(2.0, seed)
        assert len(planned) == 3
        assert [b.start - a.start for a, b in pairwise(planned)] == [7.5, 7.5]
        mean = np.mean([push.inwards for push in planned], axis=0)
        front = int(np.abs(mean).argmax())
        fronts.add((front, np.sign(mean[front])))
        for push in planned:
            assert push.duration == 2.0
            assert 15.0 <= push.force <= 30.0
            assert np.linalg.norm(push.inwards) == pytest.approx(1.0)
            assert push.inwards @ np.sign(mean) * np.eye(3)[front] @ np.abs(push.inwards) > 0.5
    assert fronts == {(1, -1.0), (1, 1.0), (0, -1.0)}


def cell(held, profile="paper"):
    return Cell(release.NAME, profile, {"held_s": held, "restrictions": "slack"})


@pytest.fixture(scope="module")
def trials(context):
    quick = cell(0.3, "paper:react.decay_cycles=25")
    return {c.where["held_s"]: release.trial(c, 100, context) for c in (quick, cell(4.0))}


def test_the_mean_follows_a_push_that_is_held_and_not_a_short_one(trials):
    for push in trials[4.0][0]["pushes"]:
        assert push["mean_peak_n"] > 0.7 * push["push_n"]
    for push in trials[0.3][0]["pushes"]:
        assert push["mean_peak_n"] < 0.5 * push["push_n"]


def test_a_row_can_be_written_and_agrees_with_the_record_whose_commands_are_within_limits(trials, panda_model):
    for row, rec in trials.values():
        json.dumps(row, allow_nan=False)
        assert len(row["pushes"]) == 3 or row["stuck"]
        assert all(push["touching_fraction"] > 0.9 for push in row["pushes"])
        assert sum(push["reactions"] for push in row["pushes"]) <= len(rec.reactions())
        fastest = max(np.linalg.norm(s.ee_velocity) for s in rec.steps)
        assert all(push["speed_towards_m_s"] < fastest for push in row["pushes"])
        assert row["stuck"] is release.stuck(rec.steps[-1])
        assert_within_limits(rec, panda_model)


def row(pushes, held=3.0):
    trial = {"experiment": "release", "held_s": held, "restrictions": "slack", "profile": "paper", "seed": 0}
    return {**trial, "pushes": pushes, "stuck": False, "held": False}


def test_pushes_of_all_trials_are_pooled_and_echoes_counted_once_a_push():
    echo = push_row(against_after_release=2, reaction_speed_towards_m_s=0.2, mean_peak_n=20.0, reactions=3)
    slipped = push_row(touching_fraction=0.5, against_after_release=1)
    cut_short = push_row(watched=False, against_after_release=1)
    trials = [row([push_row(), echo, slipped]), row([push_row(detected=False), cut_short]), row([], held=4.0)]
    summary = release.summarise(trials)
    first, second = summary["cells"]
    assert (first["trials"], first["pushes"], first["detected"], first["against_after_release"]) == (2, 3, 2, 1)
    assert (first["out"], first["stuck"]) == (3, 0)
    assert first["mean_peak_n"]["median"] == 10.0
    assert first["reaction_speed_towards_m_s"] == {"median": 0.2, "p10": 0.2, "p90": 0.2, "n": 1}
    assert (second["pushes"], second["mean_peak_n"]) == (0, None)
    (table,) = release.tables(summary)
    assert table.rows[0] == ("3", "paper", "2", "2/3", "3", "2", "0", "1", "10.0", "0.10", "0.20", "0/2")
    assert table.rows[1][-2] == "-"
    assert width(table) <= 80
