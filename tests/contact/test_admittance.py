"""The admittance: steps worked out by hand, and that it takes energy and gives none whatever is pushed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.examples import examples

from pretouch.contact.virtual_mass import (
    BRAKES_S,
    VirtualMass,
    begin,
    dead_band,
    learn_mean,
    mass_init,
    within_reach,
    yield_to,
)
from pretouch.params import AdmittanceParams
from pretouch.profiles import PROFILES
from pretouch.robot.body import placed
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel

DT, N = 0.01, 7
P = AdmittanceParams(inertia_kg_m2=2.0, damping_nm_s=20.0, speed_max_m_s=1000.0)
NO_LAG = replace(P, lag_s=0.0)
BAND = np.full(N, 1.0)
MODEL = RobotModel(panda())


def axes_of(q: np.ndarray):
    return MODEL.kinematics(q), MODEL.moved_by, MODEL.body


READY = axes_of(MODEL.description.q_ready)


def begun(params, axes, torque, before, band) -> VirtualMass:
    state = mass_init(N, params)
    begin(state, axes, torque, before, band, params)
    return state


def yielded(state: VirtualMass, torque, command, band, params, axes=READY) -> VirtualMass:
    state = VirtualMass._make(part.copy() for part in state)
    yield_to(state, np.asarray(torque, float), command, band, axes, params.numbers, DT, True)
    return state


def only(joint: int, value: float) -> np.ndarray:
    return np.eye(N)[joint] * value


def after(state: VirtualMass, torque, command=None, params=NO_LAG) -> VirtualMass:
    command = np.copysign(1e9, state.velocity) if command is None else command
    return yielded(state, torque, command, BAND, params)


def test_the_dead_band_grows_with_the_torque_limit():
    # 0.5 Nm and 2 % of 87 and 12 Nm
    np.testing.assert_allclose(dead_band(np.array([87.0, 12.0]), AdmittanceParams()), [2.24, 0.74])


def test_one_step_of_the_virtual_mass_by_hand():
    state = after(mass_init(N, NO_LAG), only(1, 6.0))
    # (2 * 0 + 0.01 * (6 - 1)) / (2 + 0.01 * 20)
    np.testing.assert_allclose(state.velocity, only(1, 0.05 / 2.2), atol=1e-15)
    state = after(state, only(1, 6.0))
    np.testing.assert_allclose(state.velocity[1], (2 * 0.05 / 2.2 + 0.05) / 2.2)
    # least energy: 6 Nm along the motion, less the dead band
    assert state.tank[0] == pytest.approx(0.2 + DT * (6.0 - 1.0) * 0.05 / 2.2)


def test_a_lasting_torque_keeps_up_the_speed_of_the_damper():
    state = mass_init(N, NO_LAG)
    for _ in range(300):
        state = after(state, only(0, -5.0))
    np.testing.assert_allclose(state.velocity, only(0, -4.0 / 20.0), atol=1e-9)


def test_a_torque_within_the_dead_band_moves_nothing():
    assert not after(mass_init(N, NO_LAG), np.linspace(-1.0, 1.0, N)).velocity.any()


def test_a_torque_is_told_from_its_mean_in_free_motion():
    state = mass_init(N, NO_LAG)
    for _ in range(5):
        learn_mean(state, np.full(N, 3.0), DT)
    np.testing.assert_allclose(state.mean, 3.0)
    np.testing.assert_allclose(after(state, np.full(N, 3.0) + only(2, 6.0)).torque, only(2, 6.0))


def test_what_has_lasted_for_60_ms_is_hardly_in_the_mean():
    state = mass_init(N, P)
    for _ in range(1000):
        learn_mean(state, np.zeros(N), DT)
    for _ in range(6):
        learn_mean(state, np.full(N, 10.0), DT)
    assert 0 < state.mean[1].max() < 0.1


def test_a_contact_begins_at_the_damper_s_speed_as_far_as_the_start_energy_goes():
    weak = begun(P, READY, only(3, 3.0), np.zeros(N), BAND)
    np.testing.assert_allclose(weak.velocity, only(3, 2.0 / 20.0))
    strong = begun(P, READY, only(3, -60.0), np.zeros(N), BAND)
    # 1/2 M v^2 = 0.2 J
    np.testing.assert_allclose(strong.velocity, only(3, -math.sqrt(0.2)))


def test_the_lag_of_the_estimate_drives_nothing_once_the_force_has_ended():
    keep = math.exp(-DT / P.lag_s)
    state = mass_init(N, P)._replace(torque=only(0, 8.0), velocity=only(0, 0.1))
    state = after(state, only(0, 8.0 * keep), params=P)
    # nothing but the damper acts
    np.testing.assert_allclose(state.velocity, only(0, 2.0 * 0.1 / 2.2))


def test_a_torque_against_the_last_push_needs_a_wider_band():
    state = mass_init(N, NO_LAG)._replace(side=only(0, 1.0))
    assert not after(state, only(0, -1.9)).velocity.any()
    assert after(state, only(0, -2.1)).velocity[0] < 0
    assert after(state, only(0, 1.9)).velocity[0] > 0


def test_a_joint_that_nothing_drives_is_asked_for_no_more_than_it_does():
    state = mass_init(N, NO_LAG)._replace(velocity=np.full(N, 0.3))
    command = np.array([0.1, -0.1, 0.0, 0.5, 0.2, 0.05, 0.3])
    slower = 2.0 * 0.3 / 2.2
    np.testing.assert_allclose(after(state, np.zeros(N), command).velocity, [0.1, 0.0, 0.0, slower, 0.2, 0.05, slower])


def test_without_energy_in_the_tank_only_what_takes_energy_moves():
    state = mass_init(N, NO_LAG)._replace(velocity=np.array([0.3, 0.3, 0, 0, 0, 0, 0]), tank=np.array([-0.1]))
    moved = after(state, [5.0, 0, 0, 0, 0, 0, 0]).velocity
    assert moved[0] > 0
    assert not moved[1:].any()


def test_no_point_of_the_body_is_faster_than_the_bound():
    model, kin = MODEL, READY[0]
    slow = replace(NO_LAG, speed_max_m_s=0.3)
    state = mass_init(N, slow)
    for _ in range(200):
        state = after(state, np.full(N, 40.0), params=slow)
    speeds = []
    for link, a, b in zip(model.body.link, model.body.a, model.body.b, strict=True):
        for end in np.linspace(a, b, 5):
            J = model.jacobian(kin, link, kin.position[link] + kin.rotation[link] @ end)
            speeds.append(np.linalg.norm(J[:3] @ state.velocity))
    assert max(speeds) == pytest.approx(0.3)


PUSHES = st.lists(
    st.tuples(st.integers(1, 40), st.lists(st.floats(-40, 40), min_size=2, max_size=2)), min_size=1, max_size=8
)


@examples(100, least=50)
@pytest.mark.slow
@given(PUSHES, st.floats(-0.4, 0.4), st.integers(0, 2**31), st.floats(0.5, 15.0))
def test_it_takes_energy_and_gives_none_whatever_is_pushed(pushes, bias, seed, acceleration):
    """Through a lagging, noisy and biased estimate, and an arm that cannot accelerate at once."""
    rng, keep = np.random.default_rng(seed), math.exp(-DT / P.lag_s)
    noise = 0.5 / ((1 + keep) / (1 - keep))  # with the bias within the dead band
    state, command, estimate = (begun(P, READY, np.zeros(N), np.zeros(N), BAND), np.zeros(N), np.zeros(N))
    taken, most, strongest = 0.0, 0.0, 0.0
    course = [*pushes, (60 + int(2.0 / (acceleration * DT)), [0.0, 0.0])]
    for samples, torques in course:
        for i in range(samples):
            true = np.zeros(N)
            true[[0, 3]] = torques
            taken += DT * float(true @ state.velocity)
            strongest = max(strongest, float(np.abs(true).sum() * np.abs(state.velocity).max()))
            most = min(most, taken)
            estimate = keep * estimate + (1 - keep) * true
            state = after(state, estimate + bias + noise * rng.uniform(-1, 1, N), command, P)
            reach = acceleration * DT
            moved = np.clip(state.velocity, command - reach, command + reach)
            if not any(torques) and i > 0:
                assert (np.abs(moved) <= np.abs(command) + 1e-12).all(), "faster after the force had ended"
            command = moved
    # what it gave back is no more than it had taken, its start energy, and what one period can bring
    assert most >= -(P.start_energy_j + DT * strongest)
    assert np.abs(command).max() < 0.05


@examples(100, least=50)
@given(st.lists(st.floats(-40, 40), min_size=N, max_size=N))
def test_a_push_never_moves_the_arm_towards_who_pushes(torque):
    """The power that the person gives is never negative, on whatever link: it is torque times joint velocity."""
    state = begun(NO_LAG, READY, np.array(torque), np.zeros(N), BAND)
    for _ in range(5):
        assert np.all(state.velocity * torque >= 0)
        state = after(state, torque)


# Static friction: a bias moves no joint, a push does, and a joint that a push moved stops under a bias

OURS = PROFILES["pretouch"].react
NOISE = np.array([1.0, 1.0, 1.0, 0.7, 0.05, 0.1, 0.02])
"""Deviation of a simulated Panda's estimate [Nm]."""


OURS_BAND = dead_band(MODEL.description.tau_max, OURS)


def course(state: VirtualMass, torque: np.ndarray, seconds: float, rng) -> tuple[np.ndarray, VirtualMass]:
    """Velocities (T, n) under a constant torque and noise, of an arm that follows."""
    command, made = state.velocity, []
    for _ in range(round(seconds / DT)):
        state = yielded(state, torque + NOISE * rng.standard_normal(N), command, OURS_BAND, OURS)
        command = state.velocity
        made.append(command)
    return np.array(made), state


@pytest.mark.parametrize("joint", range(N))
@pytest.mark.parametrize("bias", [2.0, -2.0])
def test_a_bias_of_2_nm_never_moves_an_arm_that_stands(joint: int, bias: float):
    rng = np.random.default_rng([1000, joint])
    moved, state = course(mass_init(N, OURS), bias * np.eye(N)[joint], 60.0, rng)
    assert not moved.any()
    assert state.quiet > OURS.quiet_s, "and keeps it from nothing"


@pytest.mark.parametrize("joint", range(N))
def test_a_push_of_4_nm_moves_a_joint_within_half_a_second_and_under_a_bias_it_stops(joint: int):
    rng, axis = np.random.default_rng([1001, joint]), np.eye(N)[joint]
    moved, state = course(mass_init(N, OURS), 4.0 * axis, 0.5, rng)
    assert moved[-1, joint] > 0.03
    assert not np.delete(moved, joint, axis=1).any()
    assert state.quiet[0] == 0.0
    moved, state = course(state, 8.0 * axis, 1.0, rng)
    assert moved[-1, joint] > 0.1
    moved, _ = course(state, 2.0 * axis, 30.0, rng)
    assert not moved[200:].any()


def test_noise_of_one_sample_begins_no_motion():
    torque = np.array([9.0, -6.0, 4.0, 0.0, 0.0, 3.0, 2.0])
    before = np.array([7.0, 1.0, 2.0, 0.0, 0.0, 2.9, 2.0])
    started = begun(OURS, READY, torque, before, OURS_BAND)
    # the lesser of both beyond the band, where it is more than 0.85 times the friction
    np.testing.assert_array_equal(np.flatnonzero(started.velocity), [0, 5])
    assert started.velocity[0] / started.velocity[5] == pytest.approx((7.0 - 2.24) / (2.9 - 0.74))


def test_a_noisy_and_biased_estimate_moves_nobody_who_pushes_back():
    """Over the first 0.1 s, at the point that is pushed, against the true force: without friction 16 of 3000 do."""
    model, rng, keep = MODEL, np.random.default_rng(1400), np.exp(-DT / OURS.lag_s)
    links = ("panda_link4", "panda_link6", "panda_hand")
    for i in range(300):
        q = model.description.q_ready + rng.uniform(-0.7, 0.7, N)
        axes, M, link = axes_of(q), model.mass_matrix(q), model.link_index(links[i % 3])
        kin = axes[0]
        force = rng.normal(size=3)
        force *= (5.0, 10.0, 15.0, 30.0)[i % 4] / np.linalg.norm(force)
        J = model.jacobian(kin, link, kin.position[link] + rng.uniform(-0.06, 0.06, 3))[:3]
        bias, torque, samples = rng.uniform(-1, 1, N) * np.array([1, 1, 1, 1, 0.3, 0.3, 0.1]), np.zeros(N), []
        for _ in range(16):
            torque = keep * torque + (1 - keep) * (J.T @ force)
            samples.append(torque + bias + M @ (0.48 * rng.standard_normal(N)))
        state = begun(OURS, axes, samples[4], samples[3], OURS_BAND)
        for sample in samples[5:]:
            assert force @ J @ state.velocity >= 0.0
            state = yielded(state, sample, state.velocity, OURS_BAND, OURS, axes)


# How far a contact may move the arm: the share of the joint velocities that is left near the bound

Q, REACH = MODEL.description.q_ready, 0.3
TURN = np.eye(7)[0]
"""About the base's vertical axis [rad/s]."""


def slowed(q, qd, origin):
    return within_reach(axes_of(q), qd, origin, REACH)


def ends(q):
    return np.array(placed(MODEL.body, MODEL.kinematics(q))[1:3])


def test_where_the_contact_began_nothing_is_slower():
    velocity, moved = slowed(Q, TURN, ends(Q))
    assert np.array_equal(velocity, TURN)
    assert moved == pytest.approx(0.0, abs=1e-9)


def test_near_the_bound_the_speed_away_falls_to_what_is_left_over_the_time_constant():
    origin, turned = ends(Q), Q + 0.8 * TURN
    # the chord of the farthest end, which turns about the vertical axis through the base
    radius = np.linalg.norm(origin[..., :2], axis=-1).max()
    far = 2.0 * radius * np.sin(0.4)
    assert 0.2 < far < REACH
    velocity, moved = slowed(turned, 10.0 * TURN, origin)
    assert moved == pytest.approx(far)
    # along the chord an end is faster by the radius times the cosine of half the angle
    assert velocity[0] * radius * np.cos(0.4) == pytest.approx((REACH - far) / BRAKES_S)


def test_beyond_the_bound_the_way_back_is_free_and_the_way_on_is_not():
    origin, beyond = ends(Q), Q + 1.2 * TURN
    assert not slowed(beyond, TURN, origin)[0].any()
    back, moved = slowed(beyond, -TURN, origin)
    assert moved > REACH
    assert np.array_equal(back, -TURN)


@examples(100, least=50)
@given(st.lists(st.floats(-0.6, 0.6), min_size=7, max_size=7), st.lists(st.floats(-2, 2), min_size=7, max_size=7))
def test_no_joint_turns_round_and_no_end_is_faster_away_than_is_allowed(turned, qd):
    dt = 1e-6
    origin, there, wanted = ends(Q), Q + np.array(turned), np.array(qd)
    velocity, moved = slowed(there, wanted, origin)
    share = velocity @ wanted / max(wanted @ wanted, 1e-300)
    assert -1e-12 <= share <= 1.0 + 1e-12
    np.testing.assert_allclose(velocity, share * wanted, atol=1e-12)
    far = np.linalg.norm(ends(there) - origin, axis=-1)
    assert moved == pytest.approx(far.max())
    later = np.linalg.norm(ends(there + dt * velocity) - origin, axis=-1)
    allowed = np.maximum(0.0, REACH - far) / BRAKES_S
    assert np.all(((later - far) / dt <= allowed + 1e-4) | (far < 1e-5))
