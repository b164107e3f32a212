"""Static friction: a bias moves no joint, a push does, and a joint that a push moved stops under a bias."""

import numpy as np
import pytest

from pretouch.contact.virtual_mass import VirtualMass, begun, dead_band, mass_init, yielded
from pretouch.profiles import PROFILES
from pretouch.robot.model import RobotModel

DT, N = 0.01, 7
P = PROFILES["pretouch"].react
NOISE = np.array([1.0, 1.0, 1.0, 0.7, 0.05, 0.1, 0.02])
"""Deviation of a simulated Panda's estimate [Nm]."""


@pytest.fixture(scope="module")
def arm(panda_model: RobotModel):
    return panda_model, panda_model.kinematics(panda_model.description.q_ready)


def course(state: VirtualMass, arm, torque: np.ndarray, seconds: float, rng) -> tuple[np.ndarray, VirtualMass]:
    """Velocities (T, n) under a constant torque and noise, of an arm that follows."""
    band, command, made = dead_band(arm[0].description.tau_max, P), state.velocity, []
    for _ in range(round(seconds / DT)):
        state = yielded(state, arm, torque + NOISE * rng.standard_normal(N), command, band, DT, P)
        command = state.velocity
        made.append(command)
    return np.array(made), state


@pytest.mark.parametrize("joint", range(N))
@pytest.mark.parametrize("bias", [2.0, -2.0])
def test_a_bias_of_2_nm_never_moves_an_arm_that_stands(arm, joint: int, bias: float):
    rng = np.random.default_rng([1000, joint])
    moved, state = course(mass_init(N, P), arm, bias * np.eye(N)[joint], 60.0, rng)
    assert not moved.any()
    assert state.quiet > P.quiet_s, "and keeps it from nothing"


@pytest.mark.parametrize("joint", range(N))
def test_a_push_of_4_nm_moves_a_joint_within_half_a_second(arm, joint: int):
    rng = np.random.default_rng([1001, joint])
    moved, state = course(mass_init(N, P), arm, 4.0 * np.eye(N)[joint], 0.5, rng)
    assert moved[-1, joint] > 0.03
    assert not np.delete(moved, joint, axis=1).any()
    assert state.quiet == 0.0


@pytest.mark.parametrize("joint", range(N))
def test_a_joint_that_a_push_moved_stops_under_a_bias(arm, joint: int):
    rng, axis = np.random.default_rng([1002, joint]), np.eye(N)[joint]
    moved, state = course(mass_init(N, P), arm, 8.0 * axis, 1.0, rng)
    assert moved[-1, joint] > 0.1
    moved, _ = course(state, arm, 2.0 * axis, 30.0, rng)
    assert not moved[200:].any()


def test_noise_of_one_sample_begins_no_motion(arm):
    band = dead_band(arm[0].description.tau_max, P)
    torque = np.array([9.0, -6.0, 4.0, 0.0, 0.0, 3.0, 2.0])
    before = np.array([7.0, 1.0, 2.0, 0.0, 0.0, 2.9, 2.0])
    started = begun(mass_init(N, P), *arm, torque, before, band, P)
    # the lesser of both beyond the band, where it is more than 0.85 times the friction
    np.testing.assert_array_equal(np.flatnonzero(started.velocity), [0, 5])
    assert started.velocity[0] / started.velocity[5] == pytest.approx((7.0 - 2.24) / (2.9 - 0.74))


def test_a_noisy_and_biased_estimate_moves_nobody_who_pushes_back(panda_model):
    """Over the first 0.1 s, at the point that is pushed, against the true force: without friction 16 of 3000 do."""
    model, rng, keep = panda_model, np.random.default_rng(1400), np.exp(-DT / P.lag_s)
    band, links = dead_band(model.description.tau_max, P), ("panda_link4", "panda_link6", "panda_hand")
    for i in range(300):
        q = model.description.q_ready + rng.uniform(-0.7, 0.7, N)
        kin, M, link = model.kinematics(q), model.mass_matrix(q), model.link_index(links[i % 3])
        force = rng.normal(size=3)
        force *= (5.0, 10.0, 15.0, 30.0)[i % 4] / np.linalg.norm(force)
        J = model.jacobian(kin, link, kin.position[link] + rng.uniform(-0.06, 0.06, 3))[:3]
        bias, torque, samples = rng.uniform(-1, 1, N) * np.array([1, 1, 1, 1, 0.3, 0.3, 0.1]), np.zeros(N), []
        for _ in range(16):
            torque = keep * torque + (1 - keep) * (J.T @ force)
            samples.append(torque + bias + M @ (0.48 * rng.standard_normal(N)))
        state = begun(mass_init(N, P), model, kin, samples[4], samples[3], band, P)
        for sample in samples[5:]:
            assert force @ J @ state.velocity >= 0.0
            state = yielded(state, (model, kin), sample, state.velocity, band, DT, P)
