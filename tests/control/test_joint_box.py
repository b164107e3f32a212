"""The joint box keeps position, velocity and acceleration limits at once, whatever is commanded inside it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pretouch.control.joint_box import JointLimits, brake, joint_box, viable_speed

N = 400  # independent joints, tried at once
PERIODS = [0.01, 0.001]


def limits_of(period: float, n: int = N) -> JointLimits:
    """Joints as fast as a Panda's, over a small range so that they meet their ends often."""
    rng = np.random.default_rng(3)
    return JointLimits(
        -rng.uniform(0.05, 0.6, n), rng.uniform(0.05, 0.6, n), rng.uniform(1, 2.6, n), rng.uniform(5, 20, n), period
    )


def test_viable_speed_by_numbers():
    # a = 10, dt = 0.01: a dt^2 = 0.001, so d = 0.003 is x = 3 and n = floor((5 - 1) / 2) = 2 steps of braking:
    # v = (0.003 / 0.01 + 10 * 0.01 * 2 * 3 / 2) / 3 = (0.3 + 0.3) / 3 = 0.2
    # check: 0.2, 0.1 and 0 m/s for 0.01 s each travel 0.002 + 0.001 = 0.003
    assert viable_speed(0.003, 10.0, 0.01) == pytest.approx(0.2)
    # the usual sqrt(2 a d) = 0.245 would go too far: 0.245 + 0.145 + 0.045 = 0.435 > 0.3


def test_viable_speed_is_zero_at_the_limit_and_beyond():
    assert viable_speed(0.0, 10.0, 0.01) == viable_speed(-0.1, 10.0, 0.01) == 0.0


@given(st.floats(1e-6, 5.0), st.floats(1.0, 20.0), st.sampled_from(PERIODS))
@settings(deadline=None, derandomize=True, max_examples=300)
def test_viable_speed_stops_exactly_at_the_limit(distance: float, acceleration: float, period: float):
    speed, travelled = viable_speed(distance, acceleration, period), 0.0
    while speed > 0:
        travelled += speed * period
        speed -= acceleration * period
    # exactly: not beyond it, and no more than one rounding short of it
    assert travelled == pytest.approx(distance, rel=1e-9)


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("extreme", [False, True])
def test_random_commands_never_break_a_limit(period: float, extreme: bool):
    limits, rng = limits_of(period), np.random.default_rng(5 + extreme)
    q, qd = np.random.default_rng(4).uniform(limits.q_min, limits.q_max), np.zeros(N)
    upwards, used = rng.random(N) < 0.5, np.zeros(N, dtype=bool)
    for i in range(2000 if extreme else 500):  # 800 000 or 200 000 joint steps
        lower, upper = joint_box(q, qd, limits.table)[:2]
        assert np.all(lower <= upper)
        command = np.where(upwards, upper, lower) if extreme else rng.uniform(lower, upper)
        assert np.all(np.abs(command - qd) <= limits.qdd_max * period + 1e-8 * period)
        q, qd = q + command * period, command
        left = np.minimum(q - limits.q_min, limits.q_max - q)
        assert np.all(left >= -1e-9)
        assert np.all(np.abs(qd) <= limits.qd_max + 1e-9)
        used |= left < 1e-6
        if i % 50 == 0:
            upwards ^= rng.random(N) < 0.3
    # nor is the box timid: the ends of the range are reached
    assert used.mean() > 0.9 or not extreme


@pytest.mark.parametrize("period", PERIODS)
def test_a_joint_too_fast_to_stop_in_time_brakes_at_its_acceleration_limit(period: float):
    limits = limits_of(period)
    q, qd, reach = limits.q_max - 1e-3, 0.9 * limits.qd_max, limits.qdd_max * period
    needed = np.ceil(qd / reach)
    for i in range(int(needed.max())):
        _, upper = joint_box(q, qd, limits.table)[:2]
        hard = qd > reach
        # beyond the limit nothing but full braking is left
        np.testing.assert_allclose(upper[hard], (qd - reach)[hard], rtol=1e-12)
        assert np.all(np.abs(upper - qd) <= reach + 1e-8 * period)
        q, qd = q + upper * period, upper
        assert np.all(qd[needed <= i + 1] <= 1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_velocity_above_its_limit_comes_down_at_the_acceleration_limit(sign: float):
    limits = JointLimits(np.array([-9.0]), np.array([9.0]), np.array([2.0]), np.array([10.0]), 0.01)
    lower, upper = joint_box(np.zeros(1), np.array([sign * 3.0]), limits.table)[:2]
    # 3 - 10 * 0.01 = 2.9 is the least that can be had
    np.testing.assert_allclose([lower[0], upper[0]], [sign * 2.9, sign * 2.9])


def test_a_joint_beyond_its_limit_may_only_return():
    limits = JointLimits(np.array([-1.0]), np.array([1.0]), np.array([2.0]), np.array([10.0]), 0.01)
    lower, upper = joint_box(np.array([1.2]), np.zeros(1), limits.table)[:2]
    np.testing.assert_allclose([lower[0], upper[0]], [-0.1, 0.0])


@given(arrays(np.float64, 7, elements=st.floats(-1, 1)), arrays(np.float64, 7, elements=st.floats(-1, 1)))
@settings(deadline=None, derandomize=True, max_examples=200)
def test_braking_keeps_the_box_and_ends_at_rest(at: np.ndarray, fast: np.ndarray):
    limits = limits_of(0.01, 7)
    q, qd = np.where(at > 0, limits.q_max, -limits.q_min) * at, limits.qd_max * fast
    for _ in range(60):  # 2.6 rad/s at 5 rad/s^2 is 52 periods of 0.01 s
        lower, upper = joint_box(q, qd, limits.table)[:2]
        slower = brake(qd, lower, upper, limits.table)
        assert np.all((lower <= slower) & (slower <= upper))
        q, qd = q + slower * limits.period, slower
    np.testing.assert_array_equal(qd, 0.0)


def test_braking_keeps_the_course_by_numbers():
    limits = JointLimits(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 3.0), np.array([10.0, 5.0]), 0.01)
    qd = np.array([1.0, -1.0])
    # joint 2 needs 1 / (5 * 0.01) = 20 periods, joint 1 half as many: both lose 1/20
    slower = brake(qd, *joint_box(np.zeros(2), qd, limits.table)[:2], limits.table)
    np.testing.assert_allclose(slower, [0.95, -0.95])
