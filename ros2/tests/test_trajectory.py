"""Short trajectories that end at rest: their limits, and what is reckoned from them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pretouch.control.joint_box import JointLimits, joint_box
from pretouch.robot.description import panda
from pretouch_ros2.trajectory import Reference, StoppingTrajectory, stopping_trajectory

PANDA = panda()
A, V = PANDA.qdd_max, PANDA.qd_max
PERIOD, HOLD = 0.01, 0.05
STILL = np.zeros(7)
velocities = st.lists(st.floats(-1, 1), min_size=7, max_size=7).map(lambda v: np.array(v) * V)


def begun(q: np.ndarray = PANDA.q_ready, hold: float = HOLD) -> Reference:
    reference = Reference(A, PERIOD, hold)
    reference.begin(q, 0.0, 0.5)
    return reference


def sampled(trajectory: StoppingTrajectory) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    time = np.linspace(0, trajectory.time[-1] + 0.01, 301)
    q, qd = zip(*(trajectory.at(t) for t in time), strict=True)
    return time, np.array(q), np.array(qd)


@given(qd=velocities, wanted=velocities)
def test_velocities_change_within_the_limits_are_held_and_brake_as_hard_as_they_may(qd, wanted):
    trajectory = stopping_trajectory(PANDA.q_ready, qd, wanted, A, PERIOD, HOLD)
    time, q, v = sampled(trajectory)
    assert (np.abs(np.diff(v, axis=0)) <= A * np.diff(time)[:, None] * (1 + 1e-6) + 1e-9).all()
    assert not v[-1].any()
    # positions are what the velocities add up to
    assert np.abs(np.diff(q, axis=0) - (v[1:] + v[:-1]) / 2 * np.diff(time)[:, None]).max() < 1e-4
    begin = max(HOLD, PERIOD, float((np.abs(wanted - qd) / A).max()))
    for share in (0.1, 0.5, 0.9):
        t = share * np.abs(wanted) / A
        expected = np.sign(wanted) * (np.abs(wanted) - A * t)
        for j in range(7):
            assert trajectory.at(begin + t[j])[1][j] == pytest.approx(expected[j], abs=2e-5)
    # way-points are in order and begin where the velocity was held
    points = list(trajectory.way_points())
    assert points[0].time >= HOLD
    assert all(b.time - a.time > 0.9e-6 for a, b in pairwise(points))
    assert points[0].qd == pytest.approx(wanted)
    assert not points[-1].qd.any()


def test_a_command_is_a_step_held_for_a_period_as_the_controller_takes_it():
    reference, q = begun(), PANDA.q_ready.copy()
    rng, qd = np.random.default_rng(1), STILL
    for k in range(100):
        now = 1.0 + k * PERIOD
        given_q, given_qd = reference.at(now)
        assert given_q == pytest.approx(q, abs=1e-12)
        assert given_qd == pytest.approx(qd, abs=1e-12)
        qd = np.clip(qd + rng.uniform(-1, 1, 7) * A * PERIOD, -0.5 * V, 0.5 * V)
        reference.command(qd, now)
        q = q + qd * PERIOD


@given(seed=st.integers(0, 50))
def test_braking_by_itself_ends_inside_the_joint_limits_that_the_controller_kept(seed):
    limits = JointLimits(np.full(7, -0.5), np.full(7, 0.5), V, A, PERIOD)
    reference, rng = begun(STILL, PERIOD), np.random.default_rng(seed)
    wish = rng.choice([-1, 1], 7) * V
    for k in range(60):
        now = 1.0 + k * PERIOD
        q, qd = reference.at(now)
        lower, upper = joint_box(q, qd, limits.table)[:2]
        trajectory = reference.command(np.clip(wish, lower, upper), now)
        # should this have been the last command, the arm still stops before its limits
        assert (np.abs(trajectory.q) <= 0.5 + 2e-5).all()


def test_a_late_command_finds_the_arm_braking_and_goes_on_from_there():
    reference = begun()
    fast = 0.5 * V
    for k in range(40):
        reference.command(np.minimum(fast, A * PERIOD * (k + 1)), 1.0 + k * PERIOD)
    late = 1.4 + 0.1
    _, braking = reference.at(late)
    assert (braking < fast).all()
    q, qd = reference.motion_at(late)
    trajectory = reference.command(fast, late)
    assert trajectory.at(0.0)[0] == pytest.approx(q)
    assert trajectory.at(0.0)[1] == pytest.approx(qd)
    _, _, v = sampled(trajectory)
    assert (v <= fast + 1e-9).all()


def test_what_is_asked_for_at_an_instant_before_the_last_command_is_of_the_one_before():
    reference = begun()
    one = np.full(7, 0.05)
    reference.command(one, 1.0)
    reference.command(2 * one, 1.01)
    assert reference.at(1.009)[1] == pytest.approx(one)
    assert reference.at(1.011)[1] == pytest.approx(2 * one)
    assert reference.at(0.5)[1] == pytest.approx(STILL)


def test_what_has_passed_is_told_by_the_points_between_which_velocities_are_linear():
    reference, rng = begun(), np.random.default_rng(3)
    qd = STILL
    for k in range(50):
        now = 1.0 + k * PERIOD + rng.uniform(0, 2e-3)
        passed = reference.passed(now, 0.025)
        assert passed[0].time == pytest.approx(-0.025)
        assert all(b.time - a.time > 0.9e-4 for a, b in pairwise(passed))
        assert passed[-1].time < 0
        for a, b in pairwise(passed):
            # the middle of a cubic spline between them is where it was asked for
            q = (a.q + b.q) / 2 + (a.qd - b.qd) * (b.time - a.time) / 8
            assert q == pytest.approx(reference.motion_at(now + (a.time + b.time) / 2)[0], abs=1e-6)
        qd = np.clip(qd + rng.uniform(-1, 1, 7) * A * PERIOD, -0.5 * V, 0.5 * V)
        reference.command(qd, now)


def test_the_loops_way_to_rest_is_followed_within_the_limits():
    limits = JointLimits(np.full(7, -3.0), np.full(7, 3.0), V, A, PERIOD)
    reference = begun(STILL)
    qd = STILL
    for k in range(120):
        q = reference.at(1.0 + k * PERIOD)[0]
        qd = np.minimum(0.9 * V, qd + A * PERIOD) if k < 40 else joint_box(q, qd, limits.table)[2]
        trajectory = reference.command(qd, 1.0 + k * PERIOD)
        assert (np.abs(np.diff(trajectory.qd, axis=0)) <= A * np.diff(trajectory.time)[:, None] + 1e-4).all()
    assert not qd.any()
    assert reference.ends == pytest.approx(1.0 + 119 * PERIOD + HOLD)
