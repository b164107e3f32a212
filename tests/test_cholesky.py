"""Cholesky factor and substitution, against SciPy."""

import numpy as np
from numpy.testing import assert_allclose
from scipy.linalg import solve_triangular

from pretouch.cholesky import backward, factor, forward


def matrix(seed: int) -> np.ndarray:
    A = np.random.default_rng(seed).standard_normal((7, 9))
    return A @ A.T


def test_the_factor_is_that_of_numpy():
    S, L = matrix(1), np.zeros((7, 7))
    assert factor(S, L)
    assert_allclose(L, np.linalg.cholesky(S), rtol=1e-9)


def test_substitution_solves_both_triangular_systems():
    L, b = np.linalg.cholesky(matrix(2)), np.arange(7.0)
    y, x = np.empty(7), np.empty(7)
    assert_allclose(forward(L, b, y), y @ y)
    assert_allclose(y, solve_triangular(L, b, lower=True), rtol=1e-9)
    backward(L, y, x)
    assert_allclose(x, np.linalg.solve(matrix(2), b), rtol=1e-6)


def test_what_is_not_positive_definite_is_told():
    assert not factor(np.diag([1.0, -1.0]), np.zeros((2, 2)))
    assert not factor(np.zeros((2, 2)), np.zeros((2, 2)))
    assert not factor(np.full((2, 2), np.nan), np.zeros((2, 2)))
