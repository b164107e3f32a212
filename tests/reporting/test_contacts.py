from dataclasses import replace

import numpy as np
import pytest

from pretouch.recording.run_record import TrueForces
from pretouch.reporting.contacts import contact_section, touches_of
from pretouch.reporting.measures import measure, nearest_to_body
from pretouch.reporting.page import summary
from pretouch.sim.plant import TOUCH_N
from pretouch.traces import mean_over
from pretouch.types import Mode
from tests.reporting import made


def true_course(*pushes):
    """True force of 3 s at 1 kHz: (start [s], end [s], force [N]) each."""
    time = 0.001 * np.arange(3000)
    force = np.zeros(3000)
    for start, end, size in pushes:
        force[round(1000 * start) : round(1000 * end)] = size
    return time, force


def truth_of(*pushes, touches=()):
    time, force = true_course(*pushes)
    return TrueForces(time, np.stack([0 * force, -force, 0 * force], axis=1), touches)


def test_a_true_touch_is_from_1_newton_until_it_is_over():
    (touch,) = touches_of(truth_of((1.0, 1.4, 20.0), touches=((0.999, "hand", np.array([0.0, 0.2, 0.0])),)))
    assert (touch.start, touch.end) == pytest.approx((1.0, 1.399))
    assert touch.peak == 20.0
    assert touch.peak_20ms == pytest.approx(20.0)
    assert touch.link == "hand"
    assert np.isnan(touch.lasting)


def test_a_spike_is_much_less_as_a_mean_over_20_ms_and_what_is_held_counts_from_half_a_second_on():
    spike, held = touches_of(truth_of((0.5, 0.505, 100.0), (1.0, 1.3, 100.0), (1.3, 2.0, 30.0)))
    assert (spike.peak, held.peak) == (100.0, 100.0)
    assert spike.peak_20ms == pytest.approx(25.0)
    assert held.lasting == pytest.approx(30.0)


def test_bounces_are_one_touch_and_later_ones_another():
    touches = touches_of(truth_of((1.0, 1.1, 20.0), (1.15, 1.2, 40.0), (2.0, 2.1, 10.0)))
    assert [t.start for t in touches] == pytest.approx([1.0, 2.0])
    assert [t.peak for t in touches] == [40.0, 10.0]


@pytest.mark.parametrize("time", [[0.0, np.nan, 0.002], [np.nan] * 3, [0.0, np.inf, 0.002]])
def test_no_truth_and_one_without_times_is_no_touch(time):
    assert touches_of(None) == []
    assert touches_of(truth_of()) == []
    assert touches_of(TrueForces(np.array(time), np.full((3, 3), 20.0), ())) == []


@pytest.fixture(scope="session")
def pushed(panda_model, paper_skin):
    """Three seconds at 100 Hz: pushes at 0.5 s, felt at 0.55 s, at 1 s while reacting, at 2.2 s, missed.

    At 2.8 s a contact is felt that nothing made.
    """
    time, force = true_course((0.5, 0.7, 30.0), (1.0, 1.1, 50.0), (2.2, 2.3, 5.0))
    steps, truths = [], []
    for i in range(300):
        stamp, changes = round(0.01 * i, 2), {}
        if 55 <= i < 155 or i >= 280:
            changes["mode"] = Mode.REACT
        if 55 <= i < 75:
            changes |= {"command": np.full(7, 0.1), "reaction_velocity": np.array([0.0, -0.1, 0.0])}
        if i in (55, 280):
            changes["contact"] = made.contact([0.0, -8.0, 6.0], [False, True, False])
            changes["reaction_velocity"] = np.array([0.0, -0.24, 0.18])
            changes["filtered_force"] = np.array([1.0, -9.0, 6.0])
        if 50 <= i < 75:
            changes["force"] = np.array([0.0, -25.0 if i == 60 else -20.0, 3.0])
        steps.append(made.step(panda_model, stamp=stamp, **changes))
        part = slice(10 * i, 10 * i + 10)
        truths.append(made.truth(time[part], force[part]))
    return measure(made.recorded(panda_model, paper_skin, steps, truths=truths), "pushed")


def test_a_detection_tells_force_axes_delay_and_reaction(pushed):
    first = pushed.contacts.detections[0]
    assert (first.step, first.time) == (55, 0.55)
    assert list(first.contact.axes) == [False, True, False]
    assert list(first.peak) == [0.0, -25.0, 3.0]
    assert first.peak_norm == pytest.approx(np.hypot(25.0, 3.0))
    assert first.delay == pytest.approx(0.05)
    assert first.reaction_speed == pytest.approx(0.3)
    assert first.reaction_s == pytest.approx(1.0)
    assert first.moved_s == pytest.approx(0.2)
    assert first.touch == 0


def test_a_touch_while_yielding_is_not_missed_and_a_later_one_is(pushed):
    assert pushed.contacts.unanswered == {1: Mode.REACT, 2: Mode.TRACK}
    assert [touch.peak for touch in pushed.contacts.missed] == [5.0]


def test_a_detection_without_a_touch_is_told(pushed):
    assert [d.time for d in pushed.contacts.without_touch] == [2.8]
    assert pushed.contacts.detections[1].delay is None


def test_a_contact_that_held_the_arm_still_is_told_as_that(pushed):
    assert pushed.contacts.detections[1].moved_s == 0.0
    assert "2 contacts were detected, 1 of which did not move the arm" in summary(pushed)
    assert contact_section(pushed.course, pushed.contacts).count("<td>held still</td>") == 1


def test_the_force_that_is_found_is_told_where_the_detector_says_it(panda_model, paper_skin, pushed):
    assert "is found from" not in str(summary(pushed))
    said = [8.0] * 90 + [12.4] * 6 + [30.0] * 4
    steps = [made.step(panda_model, stamp=0.01 * i, detectable_n=force) for i, force in enumerate(said)]
    told = str(summary(measure(made.recorded(panda_model, paper_skin, steps), "loud")))
    assert "for 0.1 s is found from 8 N on half of the time, and from 12 N on 95 % of the time." in told


def test_the_largest_true_force_counts_felt_or_not(pushed):
    assert pushed.contacts.peak == 50.0
    assert pushed.contacts.lasting is None


def test_without_truth_the_peak_is_that_of_the_estimate(panda_model, paper_skin):
    steps = [made.step(panda_model, stamp=0.01 * i) for i in range(100)]
    for i in range(40, 60):
        steps[i] = replace(steps[i], mode=Mode.REACT, force=np.array([3.0 * (i - 39), 0.0, 0.0]))
    steps[40] = replace(steps[40], contact=made.contact([12.0, 0.0, 0.0], [True, False, False]))
    contacts = measure(made.recorded(panda_model, paper_skin, steps), "felt").contacts
    assert not contacts.truth_known
    assert contacts.detections[0].touch is None
    assert contacts.peak == pytest.approx(60.0)
    assert contacts.without_touch == contacts.missed == ()


@pytest.mark.parametrize(("profile", "side", "push"), [("blind", "-y", 1.0), ("paper", "+y", -1.0)])
def test_numbers_of_a_collision_are_those_of_the_physics(panda_model, paper_skin, profile, side, push):
    recorded, plant = made.played(panda_model, paper_skin, profile, side, seconds=8.0, until_reaction=1.0)
    time, force = np.array([t for t, _ in plant.true_log]), np.array([f for _, f in plant.true_log])
    size = np.linalg.norm(force, axis=1)
    start = time[np.flatnonzero(size > TOUCH_N)[0]]
    m = measure(recorded, "static")
    touch, detection = m.contacts.touches[0], m.contacts.detections[0]
    answer = next(kept.step for kept in recorded if kept.step.contact is not None and kept.step.stamp >= start)
    assert touch.link == panda_model.links[plant.touches[0].link]
    assert touch.velocity[1] == pytest.approx(plant.touches[0].velocity[1])
    assert push * touch.velocity[1] < 0.0
    assert detection.delay == pytest.approx(answer.stamp - start)
    assert m.course.filtered_force[detection.step, 1] == pytest.approx(answer.filtered_force[1])
    assert m.course.force[detection.step, 1] == pytest.approx(answer.force[1])
    assert m.contacts.peak == pytest.approx(size.max())
    assert touch.peak_20ms == pytest.approx(mean_over(size, 20).max())
    assert m.contacts.without_touch == ()
    nearest = min(kept.step.obstacles.body_distance.min(initial=np.inf) for kept in recorded)
    body = nearest_to_body(m.course)
    assert (body.distance if body else np.inf) == pytest.approx(nearest)
