"""Eqs. 5-7 by numbers, and the rows against finite differences of the distance."""

from dataclasses import replace

import numpy as np
import pytest

from pretouch.control.approach import approach_limit, approach_rows, row_numbers, velocity_a, velocity_b
from pretouch.params import RestrictionParams
from pretouch.perception.closest import closest_points
from pretouch.robot.model import RobotModel
from pretouch.types import Obstacles

TABLE_I = RestrictionParams()  # V_max 0.04, beta -10, d_repulse 0.1, d_crit 0.1, d_notice 0.6
# V_max / (1 + e^10) = 0.04 / 22027.4658 and V_max / (1 + e^-10) = 0.04 / 1.0000453999
LEAST, MOST = 0.04 / 22027.4658, 0.04 / 1.0000453999


def limits(d: np.ndarray, params: RestrictionParams = TABLE_I) -> np.ndarray:
    """Eq. 7 at distances (K,) [m]."""
    return np.array([approach_limit(float(one), row_numbers(params)) for one in d])


def test_eq_5_by_numbers():
    # d = 0: exponent -10 * -1 = 10;   d = 0.05: 0, so half;   d = 0.1: -10
    np.testing.assert_allclose(velocity_a(np.array([0.0, 0.05, 0.1]), 0.04, -10.0, 0.1), [LEAST, 0.02, MOST], rtol=1e-8)
    # d = 0.025: exponent -10 * (0.5 - 1) = 5;  1 + e^5 = 149.4131591
    np.testing.assert_allclose(velocity_a(np.array([0.025]), 0.04, -10.0, 0.1), 0.04 / 149.4131591, rtol=1e-8)


def test_eq_6_by_numbers():
    # d = d_crit = 0.1: exponent 10;   d = 0.35, half way to d_notice: 0;   d = 0.6: -10
    np.testing.assert_allclose(
        velocity_b(np.array([0.1, 0.35, 0.6]), 0.04, -10.0, 0.1, 0.6), [LEAST, 0.02, MOST], rtol=1e-8
    )
    # d = 0.3: exponent -10 * (2 * 0.2 / 0.5 - 1) = 2;  1 + e^2 = 8.3890561
    np.testing.assert_allclose(velocity_b(np.array([0.3]), 0.04, -10.0, 0.1, 0.6), 0.04 / 8.3890561, rtol=1e-8)


def test_eq_7_by_numbers():
    d = np.array([-0.1, 0.05, 0.35, 0.6, 2.0])
    # deep in penetration V_a vanishes: -V_max;   0.02 - 0.04;   V_b = 0.02;   from d_notice on no restriction
    np.testing.assert_allclose(limits(d), [-0.04, -0.02, 0.02, np.inf, np.inf], rtol=1e-8)


def test_eq_7_at_d_repulse_jumps_by_no_more_than_the_tails_of_the_sigmoids():
    below, at = limits(np.array([0.1 - 1e-12, 0.1]))
    # V_a - V_max = MOST - 0.04 = -LEAST below, V_b = LEAST from there on
    np.testing.assert_allclose([below, at], [-LEAST, LEAST], rtol=1e-5)


def test_the_limit_grows_with_the_distance():
    limit = limits(np.linspace(-0.3, 0.5999, 2000))
    assert np.all(np.diff(limit) >= 0)
    assert limit[0] >= -0.04
    assert limit[-1] <= 0.04


@pytest.mark.parametrize("mode", ["hard", "slack", "floor"])
def test_no_distance_overflows(mode: str):
    d = np.linspace(-10, 10, 4001)
    limit = limits(d, replace(TABLE_I, rows=mode))
    assert not np.any(np.isnan(limit))
    assert np.all(limit >= -0.04)


def test_floor_by_numbers():
    d = np.array([-0.1, 0.05, 0.1, 0.5, 0.6])
    # V_b(0.5): exponent -10 * (2 * 0.4 / 0.5 - 1) = -6;  1 + e^-6 = 1.0024787522
    expected = [0.02, 0.02, 0.02, 0.04 / 1.0024787522, np.inf]
    np.testing.assert_allclose(limits(d, replace(TABLE_I, rows="floor")), expected, rtol=1e-8)


def around(model: RobotModel, q: np.ndarray, points: np.ndarray) -> Obstacles:
    kin, k = model.kinematics(q), len(points)
    beam = np.tile([0.0, 0.0, 1.0], (k, 1))
    return closest_points(kin, model.body, kin.position[model.ee], np.arange(k), points, beam)


def random_scene(model: RobotModel, seed: int, reach: float) -> tuple[np.ndarray, Obstacles]:
    """A posture, and points near random places of the body, some of them inside it."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(model.q_min, model.q_max)
    kin = model.kinematics(q)
    links = rng.integers(2, model.ee + 1, 12)
    return q, around(model, q, kin.position[links] + rng.uniform(-reach, reach, (12, 3)))


@pytest.mark.parametrize("seed", range(20))
def test_rows_are_the_derivative_of_the_distance_to_a_fixed_point(panda_model: RobotModel, seed: int):
    q, obstacles = random_scene(panda_model, seed, reach=0.3)
    rows = approach_rows(panda_model.kinematics(q), panda_model.moved_by, obstacles, row_numbers(TABLE_I))
    step = 1e-6
    for j in range(panda_model.n):
        ahead, back = q.copy(), q.copy()
        ahead[j] += step
        back[j] -= step
        change = (
            around(panda_model, ahead, obstacles.point).body_distance
            - around(panda_model, back, obstacles.point).body_distance
        ) / (2 * step)
        # approaching makes the distance smaller: d^T J_c qd = -d/dt distance
        np.testing.assert_allclose(rows.G[:, j], -change[rows.which], atol=1e-6)
