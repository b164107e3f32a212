"""Free motion learnt: mean against batch least squares, spread against its definition, bounds, and what is kept."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from tests.contact.alone import means_of

from pretouch.contact.learning import add_to_block, learn_turning, least_squares_step
from pretouch.contact.residual_model import (
    PLAIN,
    FreeSample,
    add_reversal_variance,
    features_into,
    features_of,
    prior_of,
    residual_init,
    spread_of_sample,
    turning_init,
)
from pretouch.contact.scatter import LENGTHS
from pretouch.params import SequentialParams
from pretouch.robot.description import panda
from pretouch.robot.model import RobotModel

P = SequentialParams()


def test_recursive_least_squares_is_the_batch_solution_with_the_same_prior():
    rng, f = np.random.default_rng(3), 5
    X, prior = rng.standard_normal((40, f)), np.array([1.0, 2.0, 0.5, 1.0, 4.0])
    y = X @ np.arange(f) + 0.3 * rng.standard_normal(40)
    w, C = np.zeros(f), np.diag(prior)
    for row, sample in zip(X, y, strict=True):
        least_squares_step(w, C, row, sample, 0.09, prior, 0.0)
    # the prior as f more equations: w_i / sqrt(prior_i) = 0
    whole = np.vstack([X / 0.3, np.diag(1 / np.sqrt(prior))])
    batch, *_ = np.linalg.lstsq(whole, np.append(y / 0.3, np.zeros(f)), rcond=None)
    assert_allclose(w, batch, rtol=1e-9)
    assert_allclose(C, np.linalg.inv(whole.T @ whole), rtol=1e-9)


def test_one_step_of_least_squares_by_hand():
    # prior 4, x = 1, noise 1, y = 5: gain 4/5, w = 4, P = 4 - 16/5 = 0.8, then half way back to 4: 2.4
    w, C = np.zeros(1), np.array([[4.0]])
    least_squares_step(w, C, np.ones(1), 5.0, 1.0, np.array([4.0]), 0.5)
    assert_allclose(w, 4.0)
    assert_allclose(C, 2.4)


@given(st.floats(-3, 3), st.floats(0.0, 0.5), st.integers(0, 1000))
def test_the_covariance_stays_between_nothing_and_the_prior_whatever_is_excited(x, forget, seed):
    rng, prior = np.random.default_rng(seed), np.array([1.0, 2.0, 3.0])
    w, C = np.zeros(3), np.diag(prior)
    for k in range(50):
        row = np.array([x, 0.0, 1e-9]) if k % 2 else rng.standard_normal(3)
        least_squares_step(w, C, row, rng.standard_normal(), 0.1, prior, forget)
    assert np.linalg.eigvalsh((C + C.T) / 2).min() > 0
    assert np.linalg.eigvalsh(np.diag(prior) - C).min() > -1e-9


@pytest.mark.parametrize("down", [(0.0, 0.0, -1.0), (0.6, 0.0, -0.8)])
def test_features_of_gravity_are_the_gravity_torques_of_the_model_and_that_of_a_load_has_its_inertia(down):
    model = RobotModel(replace(panda(), gravity=np.array(down)))
    q, growth = model.description.q_ready + 0.1, np.linspace(-3.0, 4.0, 7)
    kin = model.kinematics(q)
    x = np.empty((7, features_of(7)))
    features_into(kin, model.mechanism, np.zeros(7), np.zeros(7), x)
    _, gravity = model.mass_matrix_and_bias(q, np.zeros(7), np.zeros(7))
    # the torque that holds the arm is the opposite of what gravity does, summed over all links
    assert_allclose(x[:, PLAIN : PLAIN + 7].sum(axis=1), -gravity, atol=1e-9)
    J = model.ee_jacobian(kin)[:3]
    features_into(kin, model.mechanism, np.zeros(7), growth, x)
    assert_allclose(x[:, -1], J.T @ (9.81 * np.array(down) - J @ growth), atol=1e-12)


def test_the_spread_turns_with_the_inertia_and_has_a_floor():
    M, spread, S = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([[0.25, 1.0], [0.1, 0.0]]), np.empty((2, 2))
    spread_of_sample(M, spread, 0.2, S)
    # M diag(.25, 1) M^T = [[1 + 1, .5 + 3], [3.5, .25 + 9]]
    assert_allclose(S, [[2.0 + 0.1 + 0.04, 3.5], [3.5, 9.25 + 0.04]])


def test_both_variances_are_found_from_samples(panda_model):
    rng, n = np.random.default_rng(0), 7
    true = np.array([np.full(n, 0.2), np.array([0.03, 0.02, 0.02, 0.02, 0.01, 0.01, 0.01])])
    M, _ = panda_model.mass_matrix_and_bias(panda_model.description.q_ready, np.zeros(n), np.zeros(n))
    model, none, x = residual_init(n, P), np.zeros(n), np.zeros((n, features_of(n)))
    spread, numbers = model.spread[1], P.numbers._replace(tails=1000.0, noise_floor_nm=0.0)
    model.filled[0] = 1
    for _ in range(40):
        model.block[:] = 0.0
        for _ in range(250):
            e = M @ (np.sqrt(true[0]) * rng.standard_normal(n)) + np.sqrt(true[1]) * rng.standard_normal(n)
            add_to_block(model, FreeSample(e, e, none, x, M, none, M, none, np.ones(1, int)), np.zeros(0), numbers)
        start = n + n * features_of(n)
        spread[:] = model.block[start : start + 2 * n].reshape(2, n) / model.block[-2]
    found, expected = np.empty((n, n)), np.empty((n, n))
    spread_of_sample(M, spread, 0.0, found)
    spread_of_sample(M, true, 0.0, expected)
    assert_allclose(np.linalg.eigvals(np.linalg.solve(expected, found)).real, 1.0, atol=0.35)


def test_the_memory_is_bounded_and_the_prior_has_one_variance_a_feature():
    assert len(prior_of(7, P)) == features_of(7) == 13
    assert sum(a.nbytes for a in (residual_init(7, P).covariance, residual_init(7, P).queue)) < 20_000


# doubt where an arm accelerates hard: learnt from what is wrong there, bounded, and none elsewhere


INERTIA, SPREAD = np.diag([2.0, 1.0]), 0.04 * np.eye(2)
HARD = np.array([0.0, 10.0])


def turned(times: int, error: float, growth: np.ndarray) -> np.ndarray:
    turning, means = turning_init(2), np.full((len(LENGTHS), 2), error)
    for k in range(times):
        doubt = np.full(2, 1e-3)
        add_reversal_variance(INERTIA, growth, turning, doubt)
        learn_turning(k, means_of(SPREAD, doubt, mean=means), 0.01 / 300.0, turning)
    doubt = np.zeros(2)
    add_reversal_variance(INERTIA, growth, turning, doubt)
    return doubt


def test_what_goes_wrong_where_the_arm_turns_round_becomes_doubt_of_that_joint():
    doubt = turned(400, 0.5, HARD)
    assert doubt[0] == 0.0
    assert 0.15 < doubt[1] < 0.3


def test_it_is_bounded():
    assert turned(4000, 50.0, HARD)[1] <= 25.0


def test_it_is_gone_soon_after():
    turning = turning_init(2)
    turning[1] = 0.01
    for k in range(100):
        doubt = np.zeros(2)
        add_reversal_variance(INERTIA, HARD if k == 0 else np.zeros(2), turning, doubt)
    assert doubt[1] < 0.01 * 64.0 * 0.003
