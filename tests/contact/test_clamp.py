"""What is a clamp and what is none, by scripted courses of the torque."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.contact.clamp import begin_pinch, clamp_init, note_place, open_clamp, update_clamp
from pretouch.contact.virtual_mass import MARKS
from pretouch.params import ClampParams

P = ClampParams()
DT, N = 0.01, 7
WAY, ASIDE = np.eye(N)[0], np.eye(N)[1]
Q = np.zeros(N)


def judged(*course):
    """Clamp state after spells of (cycles, torque, velocity)."""
    state = clamp_init(Q)
    for cycles, torque, velocity in course:
        for _ in range(cycles):
            if not state.torque:
                state = update_clamp(state, torque, velocity, Q, DT, P)
    return state


PUSHED = (50, 10.0 * WAY, 0.3 * WAY)


def test_a_torque_against_the_yielding_for_30_ms_is_a_clamp():
    assert judged(PUSHED, (3, -12.0 * WAY, 0.3 * WAY)).torque == pytest.approx(12.0)


@pytest.mark.parametrize(
    "course",
    [
        (PUSHED, (2, -12.0 * WAY, 0.3 * WAY), (20, 10.0 * WAY, 0.3 * WAY)),  # a noisy sample or two
        (PUSHED, (50, 30.0 * WAY, 0.3 * WAY)),  # harder the same way
        (PUSHED, (50, 10.0 * ASIDE, 0.2 * ASIDE)),  # from the side
        (PUSHED, (50, -3.0 * WAY, 0.1 * WAY)),  # weaker than what makes a clamp
        (PUSHED, (40, 0.0 * WAY, 0.0 * WAY), (50, -12.0 * WAY, -0.3 * WAY)),  # a push of its own, later
        ((50, -12.0 * WAY, 0.01 * WAY),),  # the first contact itself, while the arm still brakes
    ],
)
def test_what_is_no_clamp(course):
    assert not judged(*course).torque


def test_sent_to_and_fro_there_is_no_way_out():
    calm = (40, 0.0 * WAY, 0.0 * WAY)
    back, on = (30, -12.0 * WAY, -0.3 * WAY), (30, 12.0 * WAY, 0.3 * WAY)
    assert not judged(PUSHED, calm, back).torque
    assert judged(PUSHED, calm, back, calm, on).torque
    # long after each other they are pushes
    long = (300, 0.0 * WAY, 0.0 * WAY)
    assert not judged(PUSHED, long, back, long, on, long, back).torque


def moved() -> tuple:
    """The state of an arm that yielded by 0.3 rad at 0.3 rad/s, and where it is."""
    state, q = clamp_init(Q), Q
    for _ in range(100):
        q = q + 0.003 * WAY
        state = update_clamp(state, 10.0 * WAY, 0.3 * WAY, q, DT, P)
    return replace(state, torque=8.0), q


def test_it_opens_the_way_it_came_and_ends_by_time():
    state, q = moved()
    start, cycles = q, 0
    while not state.open:
        way, state = open_clamp(state, 0.0 * WAY, q, DT, P)
        assert way[0] < 0
        assert not way[1:].any()
        q, cycles = q + np.clip(way, -0.2, 0.2) * DT, cycles + 1
    assert cycles == pytest.approx(P.open_s / DT, abs=1)
    assert start[0] - q[0] == pytest.approx(0.2 * P.open_s, rel=0.05)


def test_it_ends_where_the_way_began():
    state, q = moved()
    for _ in range(49):
        way, state = open_clamp(state, 0.0 * WAY, q, DT, P)
        q = q + np.clip(way, -5.0, 5.0) * DT
    assert state.open
    # the trail holds the last 12 places, 0.05 s apart
    assert q[0] == pytest.approx(0.3 - 11 * 0.05 * 0.3, abs=0.02)


def test_it_does_not_open_into_what_pushes_it():
    state, q = moved()
    for i in range(3):
        assert not state.open, i
        _, state = open_clamp(state, 12.0 * WAY, q, DT, P)
    assert state.open


# the way out of what is caught between two links


def come(cycles: int = 60):
    """The path of an arm that has turned a joint by 0.01 rad in each cycle, and where it is."""
    path, marked = np.tile(Q, (MARKS, 1)), np.zeros(1)
    for k in range(cycles):
        note_place(path, marked, 0.01 * (k + 1) * WAY, DT)
    return path, 0.01 * cycles * WAY


def test_the_arm_opens_the_way_it_came_and_does_not_close_again_what_has_been_opened_already():
    path, q = come()
    begun = begin_pinch(replace(clamp_init(q), came=1.0 * WAY), path, "one and other", 50.0, 6.0 * WAY)
    # where it was caught, and four places of the way farther back
    for at in (q, q - 0.22 * WAY):
        way, state = open_clamp(begun, -6.0 * WAY, at, DT, P)
        assert way @ WAY < 0.0
        assert way - (way @ WAY) * WAY == pytest.approx(np.zeros(N))
        assert not state.open
    beyond, state = open_clamp(state, -6.0 * WAY, -1.0 * WAY, DT, P)
    assert beyond == pytest.approx(np.zeros(N))
    assert state.open


def test_the_way_begins_anew_where_the_arm_has_been_moved():
    path, q = come()
    note_place(path, np.zeros(1), q + 0.5 * ASIDE, DT)
    assert np.all(path == q + 0.5 * ASIDE)
