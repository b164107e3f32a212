"""The sequential test: windows, likelihood ratios against SciPy, expectation under free motion, false alarms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal, multivariate_t
from tests.contact.alone import means_of

from pretouch.contact.scatter import LENGTHS, LONGEST, window_means
from pretouch.contact.sequential import Hypotheses, alarm_bound, explained_by_force, judge, log_ratio, meeting
from pretouch.params import SequentialParams
from pretouch.types import FloatArray

N = 3


def no_point(weight: FloatArray) -> Hypotheses:
    """Torques on the joints before each link only, of given weights."""
    return Hypotheses(np.zeros((0, 3, N)), np.zeros(0, np.int64), weight, np.zeros((0, 3)))


def spread() -> np.ndarray:
    A = np.random.default_rng(5).standard_normal((N, N))
    return A @ A.T + np.eye(N)


def explained(S: np.ndarray, z: np.ndarray, J: np.ndarray, away: np.ndarray) -> tuple[float, float]:
    """What a force on a point that all joints move explains of z; S is diagonal, so that its order is no matter."""
    L = np.linalg.cholesky(S)
    y = np.linalg.solve(L, z[::-1])
    return explained_by_force(L, 1 / np.diag(L), y, J, len(z), away, np.empty((len(z), 3)))


def test_windows_are_means_of_the_newest_samples():
    rng, ring = np.random.default_rng(1), np.zeros((LONGEST, 2))
    samples = rng.standard_normal((77, 2))
    for i, sample in enumerate(samples):
        ring[i % LONGEST] = sample
    means = np.zeros((len(LENGTHS), 2))
    assert window_means(ring, 77 % LONGEST, LONGEST, means) == 6
    assert_allclose(means, [samples[77 - length :].mean(axis=0) for length in LENGTHS], atol=1e-12)
    assert window_means(ring, 5, 5, means) == 3  # of five samples there are windows of 1, 2 and 4


def test_the_level_is_that_of_the_rate_of_false_alarms():
    # 360000 samples an hour at 100 Hz
    assert alarm_bound(SequentialParams(), 0.01) == pytest.approx(math.log(360_000))
    assert alarm_bound(SequentialParams(false_alarms_per_hour=0.1), 0.01) == pytest.approx(math.log(3_600_000))


@pytest.mark.parametrize("tails", [8.0, 1e9])
def test_the_ratio_is_that_of_two_densities(tails):
    S, z, g, k = spread(), np.array([1.0, -2.0, 0.5]), 15.0, 2
    # a contact on a link that the first two joints move: their torques are anything, those behind are free motion's
    behind = S[k:, k:]
    square = z @ np.linalg.solve(S, z)
    part = square - z[k:] @ np.linalg.solve(behind, z[k:])
    # (S^-1)_11^-1 is the spread of the first joints given the others: with a contact it is 1 + g times as large
    wide = S + g * np.block(
        [[np.linalg.inv(np.linalg.inv(S)[:k, :k]), np.zeros((k, N - k))], [np.zeros((N - k, k)), np.zeros((1, 1))]]
    )
    if tails > 1e6:
        one, other = (multivariate_normal(np.zeros(N), C).logpdf(z) for C in (S, wide))
    else:
        one, other = (multivariate_t(np.zeros(N), C, df=tails).logpdf(z) for C in (S, wide))
    assert log_ratio(np.log1p(square / tails), square, part, k, N, g, np.log1p(g), tails) == pytest.approx(
        other - one, rel=1e-5
    )


def test_the_part_a_force_explains_is_a_projection():
    rng, S = np.random.default_rng(2), np.eye(7)
    J, z = rng.standard_normal((3, 7)), rng.standard_normal(7)
    part, _ = explained(S, z, J, np.zeros(3))
    f, *_ = np.linalg.lstsq(J.T, z, rcond=None)
    assert part == pytest.approx(float((J.T @ f) @ (J.T @ f)), rel=1e-4)


def test_a_force_away_from_the_object_counts_twice_and_one_towards_it_nothing():
    J, away = np.eye(3, 7), np.array([0.0, 1.0, 0.0])
    z = J.T @ (10.0 * away)
    for sign, factor in ((1.0, 2.0), (-1.0, 0.0)):
        _, one_sided = explained(np.eye(7), sign * z, J, away)
        assert one_sided == pytest.approx(factor, abs=1e-9)


def test_the_expectation_of_the_statistic_in_free_motion_is_the_sum_of_the_weights():
    """Of Student's samples, as it assumes; with a small gain, so that rare large values do not carry the mean."""
    rng, S, tails = np.random.default_rng(4), spread(), 12.0
    weight, total = np.full(N, 1.0 / N), []
    for _ in range(20_000):
        means = np.zeros((len(LENGTHS), N))
        means[0] = np.linalg.cholesky(S) @ rng.standard_normal(N) / math.sqrt(rng.chisquare(tails) / tails)
        log_r, _, _ = judge(means_of(S, mean=means, whole=1), no_point(weight), 0.5, tails)
        total.append(math.exp(log_r) * len(LENGTHS))
    assert np.mean(total) == pytest.approx(1.0, abs=0.03)


def test_a_push_is_found_and_its_window_is_that_of_its_length():
    means = np.zeros((len(LENGTHS), N))
    means[:] = 0.1
    means[3] = [6.0, 0.0, 0.0]
    log_r, window, _ = judge(means_of(np.eye(N), 1e-3, mean=means), no_point(np.full(N, 1.0 / N)), 15.0, 30.0)
    assert window == 3
    assert log_r > alarm_bound(SequentialParams(), 0.01)


def test_an_outlier_of_one_sample_is_less_to_a_test_with_heavy_tails():
    means = np.full((len(LENGTHS), N), 7.0)
    heavy, light = (
        judge(means_of(np.eye(N), mean=means, whole=1), no_point(np.full(N, 1 / N)), 15.0, tails)[0]
        for tails in (5.0, 1e3)
    )
    assert heavy < 0.3 * light


# How much an object that approaches raises the prior


def test_a_meeting_by_numbers():
    # at 0.5 m/s it is 0.1 m nearer in 0.2 s: 0 and 4 deviations of 0.05 m
    assert meeting(0.1, 0.5, 0.05, 0.2) == pytest.approx((0.5, 3.17e-5), rel=1e-3)
    assert meeting(0.1, 0.0, 0.05, 0.2) == pytest.approx((0.02275, 0.02275), rel=1e-3)
    assert meeting(-1.0, 0.1, 0.05, 0.2) == pytest.approx((1.0, 1.0))


@given(st.floats(-0.1, 5.0), st.floats(-3.0, 3.0))
def test_only_what_approaches_meets(distance, closing):
    touches, before = meeting(distance, closing, 0.05, 0.2)
    assert 0.0 <= before <= touches <= 1.0
    assert closing > 0.0 or touches == before
