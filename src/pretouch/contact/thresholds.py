"""Dynamic contact thresholds: eqs. 9-11, and the test against them."""

import numpy as np

from pretouch.params import ThresholdParams
from pretouch.types import BoolArray, FloatArray, Thresholds


def noise_force(sigma: FloatArray, f_std: float, sigma_max: float) -> FloatArray:
    """F_sigma = min(sigma / sigma_max F_std, F_std) per axis [N], eq. 10 of the paper."""
    return np.minimum(sigma / sigma_max * f_std, f_std)


def obstacle_force(distance: FloatArray, f_d: float, d_max: float, d_min: float) -> FloatArray:
    """F_obs = (d_max - d) / (d_max - d_min) F_d [N], eq. 11 of the paper, clipped to [0, F_d].

    `distance` [m] is from the end-effector origin; infinite where there is no object, which gives zero.
    """
    return np.minimum(np.maximum((d_max - distance) / (d_max - d_min), 0.0), 1.0) * f_d


def side_distances(
    ee_position: FloatArray, points: FloatArray, ee_distance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance [m] to the nearest object on the positive and on the negative side of each base axis, (3,) each.

    An object belongs to the positive side of an axis if its coordinate (`points` (K, 3) [m]) is greater than the
    end-effector's, as the paper has it; sides without an object are infinitely far.
    """
    beyond = points > ee_position
    before = points < ee_position
    distance = ee_distance[:, None]
    positive = np.where(beyond, distance, np.inf).min(axis=0, initial=np.inf)
    negative = np.where(before, distance, np.inf).min(axis=0, initial=np.inf)
    return positive, negative


def thresholds(
    mean: FloatArray, sigma: FloatArray, positive: FloatArray, negative: FloatArray, params: ThresholdParams
) -> Thresholds:
    """Upper and lower contact thresholds of each axis [N], eq. 9 of the paper.

    T_u = mu + F_b + F_sigma - F_obs-, T_l = mu - F_b - F_sigma + F_obs+: an object at greater y pushes the arm
    towards -y, so it raises T_l.

    Args:
        mean: (3,) mean mu of the window [N].
        sigma: (3,) standard deviation of the window [N].
        positive: (3,) distance to the nearest object on the positive side of each axis [m].
        negative: (3,) the same for the negative side [m].
        params: F_b, F_std, sigma_max, F_d, d_max, d_min.
    """
    f_sigma = noise_force(sigma, params.f_std_n, params.sigma_max_n)
    f_positive = obstacle_force(positive, params.f_d_n, params.d_max_m, params.d_min_m)
    f_negative = obstacle_force(negative, params.f_d_n, params.d_max_m, params.d_min_m)
    return Thresholds(
        upper=mean + params.f_base_n + f_sigma - f_negative,
        lower=mean - params.f_base_n - f_sigma + f_positive,
        mean=mean,
        sigma=sigma,
        obstacle_positive=f_positive,
        obstacle_negative=f_negative,
    )


def crossed(force: FloatArray, limits: Thresholds) -> BoolArray:
    """Say for each axis (3,) whether the force [N] exceeds its upper or lower threshold."""
    return (force > limits.upper) | (force < limits.lower)
