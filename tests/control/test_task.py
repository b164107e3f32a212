"""Eq. 2 by numbers, and what the QP tracks where the hand's orientation is held."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.control.programs import task_cost

from pretouch.control.task import damping, manipulability, twist
from pretouch.params import TaskParams


def test_damping_by_numbers():
    # 0.1 * (1 - 0.0005 / 0.001)^2 = 0.1 * 0.25;   none from the threshold on;   all of it at a singularity
    assert damping(0.0005, 0.1, 0.001) == pytest.approx(0.025)
    assert damping(0.001, 0.1, 0.001) == 0.0
    assert damping(0.0, 0.1, 0.001) == 0.1


def test_manipulability_by_numbers():
    # J J^T = diag(4, 9), det 36, root 6
    assert manipulability(np.array([[2.0, 0, 0], [0, 3.0, 0]])) == pytest.approx(6.0)
    assert manipulability(np.array([[1.0, 2, 3], [2, 4, 6]])) == pytest.approx(0.0, abs=1e-6)


def test_cost_by_numbers():
    # J = (1, 2), x_d = 3; w = sqrt(5) is far from singular, so mu = 0; k = 0.1; qd_mid = (0.4 - 0.4, 1.4 - 0.4) / 5
    params = TaskParams(mid_joint_gain=0.1)
    H, f = task_cost(np.array([[1.0, 2.0]]), np.array([3.0]), np.full(2, 0.4), np.array([0.4, 1.4]), params)
    np.testing.assert_allclose(H, [[1.1, 2.0], [2.0, 4.1]])
    np.testing.assert_allclose(f, [-3.0, -6.0 - 0.1 * 0.2])


@pytest.mark.parametrize("scale", [1.0, 1e-2])
@pytest.mark.parametrize("seed", range(10))
def test_gradient_is_that_of_eq_2_written_out(seed: int, scale: float):
    rng = np.random.default_rng(seed)
    J, x_d = scale * rng.normal(size=(3, 7)), rng.normal(size=3)  # the smaller scale is damped
    q, q_mid, at = rng.normal(size=7), rng.normal(size=7), rng.normal(size=7)
    w = np.sqrt(np.linalg.det(J @ J.T))
    mu = 0.1 * (1 - w / 0.001) ** 2 if w < 0.001 else 0.0
    assert (mu > 0) == (scale < 1)

    def g(qd: np.ndarray) -> float:
        error, to_middle = x_d - J @ qd, (q_mid - q) / 5.0 - qd
        return 0.5 * error @ error + mu / 2 * qd @ qd + 0.001 / 2 * to_middle @ to_middle

    H, f = task_cost(J, x_d, q, q_mid, TaskParams())
    differences = [(g(at + 1e-4 * e) - g(at - 1e-4 * e)) / 2e-4 for e in np.eye(7)]
    np.testing.assert_allclose(H @ at + f, differences, rtol=1e-8, atol=1e-8)


def test_held_orientation_adds_the_turn_back():
    # 30 degrees to go about z at 2 1/s: 2 * sin(30 deg) = 1 rad/s
    goal = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    both = twist(np.array([0.1, 0.2, 0.3]), np.eye(3), goal, 2.0)
    np.testing.assert_allclose(both, [0.1, 0.2, 0.3, 0, 0, 1], atol=1e-12)
