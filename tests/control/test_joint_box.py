"""The joint box keeps position, velocity and acceleration limits at once, and a speed that falls towards an end."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from tests.examples import examples

from pretouch.control.joint_box import (
    JointLimits,
    brake,
    joint_box,
    joint_limits,
    viable_speed,
    viable_speed_in_envelope,
)
from pretouch.robot.description import SpeedEnvelope, fr3, panda
from pretouch.robot.model import RobotModel

N = 420  # independent joints, tried at once: the FR3's seven 30 times, and as many made up
PERIODS = [0.01, 0.001]
FR3 = RobotModel(fr3())


def plain_limits(period: float) -> JointLimits:
    """Joints as fast as a Panda's, over a small range so that they meet their ends often."""
    rng = np.random.default_rng(3)
    return JointLimits(
        -rng.uniform(0.05, 0.6, N), rng.uniform(0.05, 0.6, N), rng.uniform(1, 2.6, N), rng.uniform(5, 20, N), period
    )


def envelope_limits(period: float) -> JointLimits:
    """The FR3's joints, and joints with envelopes flatter and steeper than their brakes, over small ranges."""
    rng, arm, n = np.random.default_rng(7), joint_limits(FR3, 0.0, period), N // 2
    high, end = rng.uniform(0.1, 0.6, n), rng.uniform(-5e-3, 5e-3, n)
    offset, slope = rng.uniform(0.0, 0.5, n), rng.choice([4.0, 12.0, 40.0, 200.0], n) * rng.uniform(0.8, 1.2, n)
    past = high + end + offset**2 / slope  # so that the envelope ends a little before or after the stop
    made_up = -high, high, rng.uniform(1, 6, n), rng.uniform(5, 20, n), offset, slope, past, -past
    q_min, q_max, qd_max, qdd_max, offset, slope, q_upper, q_lower = (
        np.concatenate([np.tile(of_fr3, N // 14), more])
        for of_fr3, more in zip(np.delete(arm.table, 4, axis=0), made_up, strict=True)
    )
    return JointLimits(q_min, q_max, qd_max, qdd_max, period, SpeedEnvelope(offset, slope, q_upper, q_lower, "here"))


def allowed(q: np.ndarray, limits: JointLimits) -> tuple[np.ndarray, np.ndarray]:
    """Speeds allowed at q by the constant limit and the envelope, upwards and downwards."""
    e = limits.envelope
    if e is None:
        return limits.qd_max, limits.qd_max
    up = np.maximum(0.0, -e.offset + np.sqrt(np.maximum(0.0, e.slope * (e.q_upper - q))))
    down = np.maximum(0.0, -e.offset + np.sqrt(np.maximum(0.0, e.slope * (q - e.q_lower))))
    return np.minimum(up, limits.qd_max), np.minimum(down, limits.qd_max)


def check(q: np.ndarray, qd: np.ndarray, limits: JointLimits) -> None:
    """What a robot checks of the position and velocity it is sent."""
    up, down = allowed(q, limits)
    assert np.all((qd <= up + 1e-9) & (-qd <= down + 1e-9))
    assert np.all((q >= limits.q_min - 1e-9) & (q <= limits.q_max + 1e-9))


# One joint towards one end


def test_viable_speed_by_numbers():
    # a = 10, dt = 0.01: a dt^2 = 0.001, so d = 0.003 is x = 3 and n = floor((5 - 1) / 2) = 2 steps of braking:
    # v = (0.003 / 0.01 + 10 * 0.01 * 2 * 3 / 2) / 3 = (0.3 + 0.3) / 3 = 0.2
    # check: 0.2, 0.1 and 0 m/s for 0.01 s each travel 0.002 + 0.001 = 0.003
    assert viable_speed(0.003, 10.0, 0.01) == pytest.approx(0.2)
    # the usual sqrt(2 a d) = 0.245 would go too far: 0.245 + 0.145 + 0.045 = 0.435 > 0.3
    assert viable_speed(0.0, 10.0, 0.01) == viable_speed(-0.1, 10.0, 0.01) == 0.0


@given(st.floats(1e-6, 5.0), st.floats(1.0, 20.0), st.sampled_from(PERIODS))
@examples(300)
def test_viable_speed_stops_exactly_at_the_limit(distance: float, acceleration: float, period: float):
    speed, travelled = viable_speed(distance, acceleration, period), 0.0
    while speed > 0:
        travelled += speed * period
        speed -= acceleration * period
    # exactly: not beyond it, and no more than one rounding short of it
    assert travelled == pytest.approx(distance, rel=1e-9)


def test_the_first_period_binds_where_the_brakes_beat_the_envelope():
    # a = 10, dt = 0.01, slope 12 < 2 a, 0.1 rad off: v = 0.75337 ends its period 0.0924663 rad off, where the envelope
    # allows sqrt(12 * 0.0924663) - 0.3 = 0.75337
    assert viable_speed_in_envelope(0.1, 0.3, 12.0, 10.0, 0.01) == pytest.approx(0.75337, abs=1e-5)


def test_a_later_period_binds_where_the_envelope_beats_the_brakes():
    # a = 10, dt = 0.1, slope 34 > 2 a: of the periods of braking, one after the first leaves nothing to the envelope
    v, d, left = viable_speed_in_envelope(1.0, 0.35, 34.0, 10.0, 0.1), 1.0, []
    while v > 0:
        d -= 0.1 * v
        left.append(np.sqrt(34.0 * d) - 0.35 - v)
        v -= 1.0
    assert min(left) == pytest.approx(0.0, abs=1e-12)
    assert np.argmin(left) > 0


def braked(speed: np.ndarray, distance: np.ndarray, o: np.ndarray, b: np.ndarray, a: np.ndarray, dt: np.ndarray):
    """Largest excess over the envelope on the way from `speed` to rest at full braking."""
    excess = np.full(len(speed), -np.inf)
    while np.any(speed > 0):
        distance = distance - speed * dt
        envelope = np.maximum(0.0, -o + np.sqrt(np.maximum(0.0, b * distance)))
        excess = np.maximum(excess, np.where(speed > 0, speed - envelope, -np.inf))
        speed = np.maximum(speed - a * dt, 0.0)
    return excess


def test_the_viable_speed_is_the_largest_from_which_full_braking_keeps_the_envelope():
    rng, n = np.random.default_rng(8), 20_000
    distance, o, b = 10 ** rng.uniform(-4, 0.5, n), rng.uniform(0.0, 0.6, n), 10 ** rng.uniform(0, 2.5, n)
    a, dt = rng.uniform(2, 20, n), 10 ** rng.uniform(-3, -1.3, n)
    speed = np.array([viable_speed_in_envelope(*case) for case in zip(distance, o, b, a, dt, strict=True)])
    assert braked(speed, distance, o, b, a, dt).max() < 1e-9
    # and nothing faster is: nowhere is there a hundred thousandth to spare
    assert braked(speed * (1 + 1e-5) + 1e-9, distance, o, b, a, dt).min() > 0
    # all three ways to bind are among the cases
    assert min((speed == 0).mean() / 0.05, (b > 2 * a).mean() / 0.2, (b < 2 * a).mean() / 0.2) > 1.0


@given(st.floats(-1, 5), st.floats(0, 1), st.floats(0.5, 300), st.floats(1, 20), st.sampled_from([*PERIODS, 0.05]))
@example(0.01, 0.3, 9.0, 10.0, 0.01)  # the distance is offset^2 / slope: the envelope's own end
@example(0.5, 0.3, 20.0, 10.0, 0.01)  # the envelope is just as steep as the brakes
@example(0.5, 0.0, np.nextafter(20.0, 30.0), 10.0, 0.01)
@examples(500)
def test_the_viable_speed_is_continuous_and_falls_towards_the_end(distance, offset, slope, acceleration, period):
    def at(d: float) -> float:
        return viable_speed_in_envelope(d, offset, slope, acceleration, period)

    assert 0 <= at(distance) <= at(distance + 1e-3)
    assert at(distance + 1e-12) - at(distance) < 1e-5
    assert distance > offset**2 / slope or at(distance) == 0


# The box


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("greedy", [True, False])
@pytest.mark.parametrize("limits_of", [plain_limits, envelope_limits])
def test_random_commands_never_break_a_limit(limits_of, period: float, greedy: bool):
    rng, limits = np.random.default_rng(9), limits_of(period)
    q, qd, e = rng.uniform(limits.q_min, limits.q_max), np.zeros(N), limits.envelope
    if e is not None:
        q = np.clip(q, e.q_lower, e.q_upper)
    upwards, used = rng.random(N) < 0.5, np.zeros(N, dtype=bool)
    for i in range(2500 if greedy or e else 500):  # 1 050 000 joint steps
        lower, upper, _ = joint_box(q, qd, limits.table)
        assert np.all(lower <= upper)
        command = np.where(upwards, upper, lower) if greedy else rng.uniform(lower, upper)
        assert np.all(np.abs(command - qd) <= limits.qdd_max * period + 1e-8 * period)
        check(q, command, limits)  # as the period begins
        q, qd = q + command * period, command
        check(q, qd, limits)  # as it ends
        if e is None:
            used |= np.minimum(q - limits.q_min, limits.q_max - q) < 1e-6
        else:
            up, down = allowed(q, limits)
            used |= (np.where(qd > 0, up - qd, down + qd) < 1e-6) & (np.abs(qd) > 1e-3) & (np.abs(qd) < limits.qd_max)
        if i % 50 == 0:
            upwards ^= rng.random(N) < 0.3
    # nor is the box timid: the ends of the range are reached, the envelope itself is ridden on
    assert used.mean() > (0.9 if e is None else 0.8) or not greedy


@pytest.mark.parametrize("period", PERIODS)
def test_a_joint_too_fast_to_stop_in_time_brakes_at_its_acceleration_limit(period: float):
    limits = plain_limits(period)
    q, qd, reach = limits.q_max - 1e-3, 0.9 * limits.qd_max, limits.qdd_max * period
    needed = np.ceil(qd / reach)
    for i in range(int(needed.max())):
        _, upper = joint_box(q, qd, limits.table)[:2]
        fast = qd > reach
        # beyond the limit nothing but full braking is left
        np.testing.assert_allclose(upper[fast], (qd - reach)[fast], rtol=1e-12)
        assert np.all(np.abs(upper - qd) <= reach + 1e-8 * period)
        q, qd = q + upper * period, upper
        assert np.all(qd[needed <= i + 1] <= 1e-12)


@pytest.mark.parametrize("period", PERIODS)
def test_full_braking_brings_a_joint_back_below_the_envelope(period: float):
    limits = envelope_limits(period)
    q, qd, reach = limits.q_max - 1e-3, 0.9 * limits.qd_max, limits.qdd_max * period
    assert np.all(qd > allowed(q, limits)[0])
    for _ in range(int(np.ceil((qd / reach).max()))):
        _, upper = joint_box(q, qd, limits.table)[:2]
        too_fast = qd - reach > allowed(q, limits)[0]
        np.testing.assert_allclose(upper[too_fast], (qd - reach)[too_fast], rtol=1e-12)
        q, qd = q + upper * period, upper
    assert np.all(qd <= allowed(q, limits)[0] + 1e-12)
    for _ in range(int(5.0 / period)):  # and from there it can come back
        qd = joint_box(q, qd, limits.table)[0]
        q = q + qd * period
    check(q, qd, limits)


@pytest.mark.parametrize(
    ("q", "qd", "bounds"),
    [
        # 3 - 10 * 0.01 = 2.9 is the least that can be had of a velocity above the limit of 2
        (0.0, 3.0, (2.9, 2.9)),
        (0.0, -3.0, (-2.9, -2.9)),
        (1.2, 0.0, (-0.1, 0.0)),  # a joint beyond its limit may only return
    ],
)
def test_beyond_a_limit_the_box_leads_back_by_numbers(q: float, qd: float, bounds: tuple[float, float]):
    limits = JointLimits(np.array([-1.0]), np.array([1.0]), np.array([2.0]), np.array([10.0]), 0.01)
    lower, upper = joint_box(np.array([q]), np.array([qd]), limits.table)[:2]
    np.testing.assert_allclose([lower[0], upper[0]], bounds)


singular = st.sampled_from([0.0, 1.0, -1.0, 1 + 1e-12, 1 - 1e-12, -1 - 1e-12, 1.5, -1.5, 1e6]) | st.floats(-3, 3)


@given(arrays(np.float64, 7, elements=singular), arrays(np.float64, 7, elements=singular), st.sampled_from(PERIODS))
@examples(500)
def test_the_box_is_sound_from_any_state(at: np.ndarray, fast: np.ndarray, period: float):
    limits = joint_limits(FR3, 0.01, period)
    q = FR3.q_mid + at * (limits.q_max - FR3.q_mid)
    qd, reach = limits.qd_max * fast, limits.qdd_max * period
    lower, upper, stop = joint_box(q, qd, limits.table)
    assert np.all((qd - reach <= lower) & (lower <= stop) & (stop <= upper) & (upper <= qd + reach))
    with_margin, without = allowed(q, limits), joint_box(q, qd, replace(limits, envelope=None).table)[:2]
    # beyond what the envelope allows at once, only full braking is left, and it takes nothing the brakes cannot
    assert np.all(upper <= np.maximum(with_margin[0], qd - reach) + 1e-9)
    assert np.all(-lower <= np.maximum(with_margin[1], -qd - reach) + 1e-9)
    assert np.all((qd - reach <= without[0]) & (without[0] <= lower))
    assert np.all((upper <= without[1]) & (without[1] <= qd + reach))


# Braking


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("limits_of", [plain_limits, envelope_limits])
def test_braking_keeps_the_box_and_ends_at_rest(limits_of, period: float):
    rng, limits = np.random.default_rng(10), limits_of(period)
    q, qd = rng.uniform(limits.q_min, limits.q_max), np.zeros(N)
    upwards = rng.random(N) < 0.5
    for _ in range(int(0.3 / period)):
        lower, upper = joint_box(q, qd, limits.table)[:2]
        q, qd = q + np.where(upwards, upper, lower) * period, np.where(upwards, upper, lower)
    for _ in range(int(6.0 / 5.0 / period) + 1):  # 6 rad/s at 5 rad/s^2
        lower, upper, stop = joint_box(q, qd, limits.table)
        assert np.all((lower <= stop) & (stop <= upper))
        q, qd = q + stop * period, stop
        check(q, qd, limits)
    np.testing.assert_array_equal(qd, 0.0)


def test_braking_keeps_the_course_by_numbers():
    limits = JointLimits(np.full(2, -9.0), np.full(2, 9.0), np.full(2, 3.0), np.array([10.0, 5.0]), 0.01)
    qd = np.array([1.0, -1.0])
    # joint 2 needs 1 / (5 * 0.01) = 20 periods, joint 1 half as many: both lose 1/20
    slower = brake(qd, *joint_box(np.zeros(2), qd, limits.table)[:2], limits.table)
    np.testing.assert_allclose(slower, [0.95, -0.95])


# The limits of an arm


def test_limits_that_depend_on_the_position_move_in_by_the_margin():
    limits, arm = joint_limits(FR3, 0.02, 0.01), fr3()
    np.testing.assert_allclose(limits.q_max, FR3.q_max - 0.02)
    np.testing.assert_allclose(limits.q_min, FR3.q_min + 0.02)
    np.testing.assert_allclose(limits.envelope.q_upper, arm.envelope.q_upper - 0.02)
    np.testing.assert_allclose(limits.envelope.q_lower, arm.envelope.q_lower + 0.02)
    np.testing.assert_array_equal(limits.table[2:4], [arm.qd_max, arm.qdd_max])


def test_an_arm_without_an_envelope_has_the_limits_of_its_range(panda_model):
    limits, arm = joint_limits(panda_model, 0.01, 0.001), panda()
    plain = JointLimits(panda_model.q_min + 0.01, panda_model.q_max - 0.01, arm.qd_max, arm.qdd_max, 0.001)
    for q in (arm.q_ready, limits.q_max - 1e-4):
        np.testing.assert_array_equal(joint_box(q, np.zeros(7), limits.table), joint_box(q, np.zeros(7), plain.table))


def test_a_speed_away_from_the_end_is_not_limited_by_it():
    limits = joint_limits(FR3, 0.0, 0.01)
    np.testing.assert_allclose(joint_box(limits.q_max, np.zeros(7), limits.table)[0], -0.1)
