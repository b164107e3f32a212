"""What is told of touches and ghosts, by numbers by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from pretouch.modes import Event, Mode
from pretouch.sim.plant import Touch
from pretouch.types import no_obstacles
from pretouch_lab.bench.avoidance_scenes import arm
from pretouch_lab.bench.obstacle import Ball, nearest
from pretouch_lab.encounters import Encounter, encounters, ghosts, met
from pretouch_lab.trial import Record

READY = arm().description.q_ready


@pytest.mark.parametrize(
    ("speeds", "peak", "soft", "by_hand"),
    [
        ((0.06, 0.0), 15.0, True, False),
        ((0.07, 0.0), 1.0, False, False),
        ((0.05, 0.0), 15.1, False, False),
        ((0.05, 0.04), 70.0, False, False),
        ((0.05, 0.06), 70.0, False, True),
        ((-0.1, 0.0), 1.0, True, False),
        ((0.07, 0.8), 70.0, False, False),
    ],
)
def test_a_touch_is_soft_by_speed_and_force_and_by_the_hand_if_that_comes_faster_at_a_slow_arm(
    speeds, peak, soft, by_hand
):
    touch = Encounter(0, 8, *speeds, peak, 0.0)
    assert (touch.soft, touch.by_hand) == (soft, by_hand)


def test_touches_by_the_hand_count_apart():
    soft, pushed, by_hand = (Encounter(0, 8, *each) for each in ((0.05, 0, 9, 0), (0.01, 0, 3, 60), (0, 0.5, 70, 0)))
    assert tuple(met([]).values()) == (True, True, None, None, 0)
    assert met([by_hand]) == met([]) | {"by_hand": 1}
    assert tuple(met([soft, pushed, by_hand]).values()) == (False, True, 0.05, 9, 2)


def test_separate_touches_have_the_speeds_before_them_and_the_force_until_the_hand_withdraws():
    """A ball comes at the hand of a standing arm with 0.2 m/s, and touches it at 1 s."""
    model, hand = arm(), arm().link_index("panda_hand")
    kin = model.kinematics(READY)
    body = model.body.of_links(np.flatnonzero(model.rigid == model.rigid[hand]))
    tip = nearest(kin, body, Ball(kin.position[hand] + [0.5, 0.0, 0.0], 0.1))
    times = 0.01 * np.arange(300)
    balls = np.array([tip.point + (0.1 + 0.2 * max(1.0 - t, 0.0)) * tip.direction for t in times])
    steps = [SimpleNamespace(stamp=t, q=READY) for t in times]
    true = 0.005 * np.arange(1, 600)
    force = np.select([true < 1.0, true < 1.1, true < 1.3, true < 1.5, true < 1.6], [0.0, 8.0, 0.0, 5.0, 40.0], 0.0)
    touches = [Touch(t, hand, 0.05 * tip.direction) for t in (1.0, 1.02, 1.3)]
    record = Record(steps, true, np.outer(force, [0.0, 1.0, 0.0]), touches, balls)
    first, second = encounters(record, model, lambda place: Ball(place, 0.1), [1.5])
    assert (first.step, first.arm_m_s, first.peak_n, first.leaving_n) == (99, 0.05, 8.0, 0.0)
    assert first.hand_m_s == pytest.approx(0.2, abs=1e-3)
    assert (second.step, second.hand_m_s, second.peak_n, second.leaving_n) == (129, 0.0, 5.0, 40.0)
    assert encounters(record, model, lambda place: Ball(place, 0.1))[1].peak_n == 40.0


def ahead(skin, away):
    """Return the point on the axis of the first unit, at a distance [m]."""
    kin, T = arm().kinematics(READY), skin.T_link_sensor[0]
    return kin.position[skin.link[0]] + kin.rotation[skin.link[0]] @ (T[:3, 3] + away * T[:3, 2])


def course(place, slows, distance=np.nan):
    """Steps at 100 Hz: one second free, two at a fifth of 0.3 m/s, one free; an obstacle slows in some of them."""
    phases = np.cumsum(np.where((np.arange(400) < 100) | (np.arange(400) >= 300), 0.003, 0.0006))
    near = no_obstacles(1)
    near.point[0], near.body_distance[0] = place, 0.02
    usual = {"mode": Mode.TRACK, "event": Event.CLEAR, "q": READY, "restricted": np.array([0]), "speed_scale": 1.0}
    usual |= {"desired_velocity": np.array([0.3, 0.0, 0.0]), "ee_velocity": np.zeros(3), "obstacles": near}
    usual["range_distance"] = np.full(7, distance)
    answers = [
        SimpleNamespace(multipliers=np.append(np.zeros(7), slow), slack=np.zeros(1), violated=False)
        for slow in (0.0, 1.0)
    ]
    return [
        SimpleNamespace(stamp=0.01 * i, path_phase=phase, qp=answers[i in slows], **usual)
        for i, phase in enumerate(phases)
    ]


def told(steps, hand, skin, speed=0.3):
    record = Record(steps, np.zeros(0), np.zeros((0, 3)), [], np.array(hand))
    return tuple(ghosts(record, arm(), skin, 0.05, speed).values())


def test_an_obstacle_with_nothing_near_it_is_a_ghost_and_holds_the_arm_as_long_as_it_is_slow(paper_skin):
    place, nobody = ahead(paper_skin, 0.3), np.full((400, 3), np.nan)
    steps = course(place, [i for i in range(100, 300) if i != 250])
    # 14 cm from the fist until 2 s, then the person is gone
    hand = [np.add(place, (0.19 if i < 200 else 1.0, 0.0, 0.0)) for i in range(400)]
    assert told(steps, hand, paper_skin)[:2] == (99 / 400, pytest.approx(1.0, abs=0.011))
    assert told(steps, hand, paper_skin, speed=0.1)[1] == 0.0, "it is as fast as it should be"
    assert told(steps, nobody, paper_skin)[0] == 199 / 400


def test_a_ghosts_place_is_seen_empty_after_a_tenth_of_a_second_in_view_with_nothing_nearer(paper_skin):
    nobody, slows = np.full((400, 3), np.nan), range(100, 300)
    seen, behind, out = (
        told(course(ahead(paper_skin, away), slows, distance), nobody, paper_skin)
        for away, distance in ((0.3, np.nan), (0.3, 0.2), (5.0, np.nan))
    )
    assert seen[1:] == (pytest.approx(2.0, abs=0.011), pytest.approx(1.9, abs=0.011))
    assert behind[2] == out[2] == 0.0


def test_after_a_contact_the_arm_waits_for_obstacles_that_are_seen_near_it(paper_skin):
    steps = course(np.zeros(3), ())
    for each in steps[100:]:
        each.mode, each.event, each.touched = Mode.REACT, Event.YIELDING, SimpleNamespace(link=[])
    assert told(steps, np.full((400, 3), np.nan), paper_skin)[0] == 0.75
