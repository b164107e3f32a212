"""Dynamic contact thresholds: eqs. 9-11, and the test against them."""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import BoolArray, FloatArray, Number, Thresholds


@compiled
def noise_force(sigma: Number, f_std: float, sigma_max: float) -> Number:
    """F_sigma = min(sigma / sigma_max F_std, F_std) per axis [N], eq. 10 of the paper."""
    return np.minimum(sigma / sigma_max * f_std, f_std)


@compiled
def obstacle_force(distance: Number, f_d: float, d_max: float, d_min: float) -> Number:
    """F_obs = (d_max - d) / (d_max - d_min) F_d [N], eq. 11 of the paper, clipped to [0, F_d].

    `distance` [m] is from the end-effector origin; infinite where there is no object, which gives zero.
    """
    return np.minimum(np.maximum((d_max - distance) / (d_max - d_min), 0.0), 1.0) * f_d


@compiled
def side_distances(
    ee_position: FloatArray, points: FloatArray, ee_distance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance [m] to the nearest object on the positive and on the negative side of each base axis, (3,) each.

    An object belongs to the positive side of an axis if its coordinate (`points` (K, 3) [m]) is greater than the
    end-effector's, as the paper has it; sides without an object are infinitely far.
    """
    positive, negative = np.full(3, np.inf), np.full(3, np.inf)
    for k in range(len(points)):
        for i in range(3):
            # By the object's distance, not by its part along the axis: one straight at -y lowers thresholds of x and z
            # too, on the side to which it is a little off (docs/explanation/paper.md, axis leakage).
            if points[k, i] > ee_position[i]:
                positive[i] = min(positive[i], ee_distance[k])
            elif points[k, i] < ee_position[i]:  # level with the end-effector it is on neither side
                negative[i] = min(negative[i], ee_distance[k])
    return positive, negative


class ThresholdNumbers(NamedTuple):
    """What is taken of `ThresholdParams`."""

    f_base_n: float
    f_std_n: float
    sigma_max_n: float
    f_d_n: float
    d_max_m: float
    d_min_m: float


@compiled
def threshold_parts(
    mean: FloatArray, sigma: FloatArray, positive: FloatArray, negative: FloatArray, p: ThresholdNumbers,
    parts: FloatArray,
) -> None:  # fmt: skip
    """Write thresholds of each axis [N] and what they are made of, eq. 9 of the paper: `Thresholds.parts` (6, 3).

    T_u = mu + F_b + F_sigma - F_obs-, T_l = mu - F_b - F_sigma + F_obs+: an object at greater y pushes the arm
    towards -y, so it raises T_l. Mean mu and standard deviation of the window are (3,) [N], distances to the nearest
    object on the positive and the negative side of each axis (3,) [m].
    """
    for i in range(3):
        f_sigma = noise_force(sigma[i], p.f_std_n, p.sigma_max_n)
        f_positive = obstacle_force(positive[i], p.f_d_n, p.d_max_m, p.d_min_m)
        f_negative = obstacle_force(negative[i], p.f_d_n, p.d_max_m, p.d_min_m)
        # eq. 9: what is on the negative side pushes to the positive one, and lowers the upper threshold
        parts[0, i] = mean[i] + p.f_base_n + f_sigma - f_negative
        parts[1, i] = mean[i] - p.f_base_n - f_sigma + f_positive
        parts[2, i], parts[3, i], parts[4, i], parts[5, i] = mean[i], sigma[i], f_positive, f_negative


def crossed(force: FloatArray, limits: Thresholds) -> BoolArray:
    """Say for each axis (3,) whether the force [N] exceeds its upper or lower threshold."""
    return (force > limits.upper) | (force < limits.lower)
