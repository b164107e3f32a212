"""The least squares: its derivatives, and what its covariance counts; `test_calibrate` tells whether it is honest."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pretouch.calibration.fit import CLOCK, LAG, UPWARDS, Estimate, Problem, fit, start
from pretouch.calibration.link_motion import LinkMotion
from pretouch.calibration.signals import Measured
from pretouch.calibration.values import RATE_HZ

NOISE = np.repeat((0.003, 0.02), 3)
TIME = np.arange(0, 60, 1 / RATE_HZ)


def motion(seed=0):
    """A link that turns, all derivatives exact; up turns with it."""
    rng = np.random.default_rng(seed)
    frequency, phase = rng.uniform(0.2, 0.9, 3), rng.uniform(0, 6, 3)
    angle = 2 * np.pi * frequency * TIME[:, None] + phase
    turned = Rotation.from_rotvec(-np.cos(angle)).as_matrix().swapaxes(1, 2)
    alpha = 2 * np.pi * frequency * np.cos(angle)
    w, a = np.sin(angle), 0.8 * np.sin(angle[:, ::-1] + 1.0)
    lever = np.stack([np.cross(alpha, x) + np.cross(w, np.cross(w, x)) for x in np.eye(3)], axis=2)
    return LinkMotion(w, a, turned, lever)


def truth(seed=0, gravity=(0.0, 0.0, 9.81)):
    rng = np.random.default_rng([seed, 1])
    R, p = Rotation.random(random_state=seed).as_matrix(), rng.uniform(-0.1, 0.1, 3)
    biases, scales = np.split(rng.uniform(-1, 1, 12) * np.repeat((0.4, 0.1, 0.01), (3, 3, 6)), 2)
    return Estimate(R, p, np.concatenate([np.zeros(6), biases, [0.004, 0.0003], scales, gravity]))


def measured(link, true, noise=None, seed=0):
    """What an IMU tells whose clock is late; its rates are by differences."""
    exact = true.expected(link)
    rates = np.gradient(exact, TIME, axis=0)
    late = np.repeat((true.errors[CLOCK], true.errors[CLOCK] + true.errors[LAG]), 3)
    values = exact - late * rates
    if noise is not None:
        values = values + noise * np.random.default_rng([seed, 2]).standard_normal(values.shape)
    return Measured(values, rates)


def test_the_jacobian_is_that_of_finite_differences():
    link, true = motion(), truth()
    problem = Problem(link, measured(link, truth(3)), true, NOISE)
    x = np.random.default_rng(5).uniform(-0.3, 0.3, 23)
    J, h = problem.jacobian(x), 1e-6
    for k in range(23):
        step = h * (np.arange(23) == k)
        expected = (problem.residuals(x + step) - problem.residuals(x - step)) / (2 * h)
        assert J[:, k] == pytest.approx(expected, rel=1e-5, abs=1e-4)


def test_the_closed_form_is_near_enough_to_start_from():
    for seed in range(20):
        link, true = motion(seed=seed), truth(seed)
        found = start(link, measured(link, true, NOISE, seed))
        assert np.linalg.norm(found.p - true.p) < 0.02
        assert Rotation.from_matrix(found.R.T @ true.R).magnitude() < 0.05
        assert np.linalg.det(found.R) == pytest.approx(1.0)


def test_few_blocks_are_not_believed_beyond_what_independent_errors_would_say():
    # six seconds: the 23 unknowns can make six blocks agree, whatever the errors are
    link, told = motion(), []
    short = slice(0, 150)
    for seed in range(60):
        true = truth(seed)
        data = measured(link, true, NOISE, seed)
        part = link.at(short)
        found = fit(part, Measured(data.values[short], data.rates[short]), true, NOISE)
        e = np.concatenate([Rotation.from_matrix(found.estimate.R.T @ true.R).as_rotvec(), true.p - found.estimate.p])
        told.append(float(e @ np.linalg.solve(found.covariance[:6, :6], e)))
    assert np.mean(told) < 6.0
    assert np.max(told) < 30.0


def test_the_covariance_counts_errors_that_last():
    link, true = motion(), truth()
    slow = np.repeat(np.random.default_rng(9).standard_normal((len(TIME) // 20, 6)), 20, axis=0)
    exact = measured(link, true)
    lasting = Measured(exact.values + NOISE * slow, exact.rates)
    fast = measured(link, true, NOISE)
    sigma = [np.trace(fit(link, d, true, NOISE).covariance[3:6, 3:6]) ** 0.5 for d in (fast, lasting)]
    assert sigma[1] > 2.5 * sigma[0]


def test_large_differences_count_less_when_robust():
    link, true = motion(), truth()
    data = measured(link, true, NOISE)
    data.values[200:260] += 5.0
    plain = fit(link, data, true, NOISE).estimate
    robust = fit(link, data, true, NOISE, robust=True).estimate
    assert np.linalg.norm(robust.p - true.p) < 0.25 * np.linalg.norm(plain.p - true.p)


@pytest.mark.parametrize("gravity", [(0.0, 0.0, 9.78), (0.0, 0.0, 9.832), (0.12, -0.08, 9.809)])
def test_an_arm_elsewhere_or_off_level_does_not_move_the_unit(gravity):
    link, true = motion(seed=4), truth(4, gravity)
    data = measured(link, true)
    found = fit(link, data, start(link, data), NOISE).estimate
    assert found.p == pytest.approx(true.p, abs=2e-4)
    assert found.errors[UPWARDS] == pytest.approx(true.errors[UPWARDS], abs=2e-3)
