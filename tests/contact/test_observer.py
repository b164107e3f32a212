"""The momentum observer on an exactly simulated arm, and the wrench made of its torques."""

import numpy as np
import pytest

from pretouch.robot.model import RobotModel
from pretouch.sim.observer import observe, observer_init, wrench_from_torques

GAIN, DT = 50.0, 5e-4
TAU_EXT = np.array([3.0, -8.0, 2.0, 5.0, -1.0, 0.5, -0.2])


def acceleration(model: RobotModel, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> np.ndarray:
    mass, bias = model.mass_matrix_and_bias(q, qd, np.zeros(model.n))
    return np.linalg.solve(mass, tau - bias)


def step(model: RobotModel, q: np.ndarray, qd: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One step of the classical Runge-Kutta method, torques held."""
    k1 = acceleration(model, q, qd, tau)
    k2 = acceleration(model, q + DT / 2 * qd, qd + DT / 2 * k1, tau)
    k3 = acceleration(model, q + DT / 2 * qd + DT**2 / 4 * k1, qd + DT / 2 * k2, tau)
    k4 = acceleration(model, q + DT * qd + DT**2 / 2 * k2, qd + DT * k3, tau)
    return q + DT * qd + DT**2 / 6 * (k1 + k2 + k3), qd + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def residuals(model: RobotModel, tau_ext: np.ndarray, duration: float, gain: float = GAIN) -> np.ndarray:
    """Residual after each step of a swinging arm whose sensors and model are perfect."""
    q, qd = model.description.q_ready.copy(), np.array([0.4, -0.3, 0.5, 0.4, -0.5, 0.6, -0.4])
    mass, _ = model.mass_matrix_and_bias(q, qd, np.zeros(model.n))
    state, seen = observer_init(mass, qd), []
    for _ in range(round(duration / DT)):
        _, bias = model.mass_matrix_and_bias(q, qd, np.zeros(model.n))
        tau = bias - 2.0 * qd
        q, qd = step(model, q, qd, tau + tau_ext)
        mass, bias = model.mass_matrix_and_bias(q, qd, np.zeros(model.n))
        state = observe(state, mass, bias, qd, tau, gain, DT)
        seen.append(state.residual)
    return np.array(seen)


def test_residual_rises_with_time_constant_one_over_gain(panda_model: RobotModel):
    seen = residuals(panda_model, TAU_EXT, 8 / GAIN)
    for constants in (1, 2):
        share = seen[round(constants / GAIN / DT) - 1] / TAU_EXT
        np.testing.assert_allclose(share, 1 - np.exp(-constants), atol=0.03)
    # after 8 time constants exp(-8) = 0.03 % is missing; what the moving arm adds is the error of one step
    np.testing.assert_allclose(seen[-1], TAU_EXT, rtol=0.02, atol=0.02)


def test_any_gain_is_stable(panda_model: RobotModel):
    # gain times step 50: an explicit low-pass would diverge
    seen = residuals(panda_model, TAU_EXT, 0.02, gain=1e5)
    np.testing.assert_allclose(seen[-1], TAU_EXT, rtol=0.05, atol=0.05)


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_known_wrench_is_recovered_with_its_sign(panda_model: RobotModel, axis: int, sign: float):
    q = panda_model.description.q_ready
    jacobian = panda_model.ee_jacobian(panda_model.kinematics(q))
    force = np.zeros(6)
    force[axis] = sign * 20.0  # [N], then [Nm]
    wrench = wrench_from_torques(panda_model.hinges, panda_model.mechanism.arm, q, jacobian.T @ force, 1e-3, 0.01)
    assert wrench is not None
    np.testing.assert_allclose(wrench, force, atol=0.01)


def test_there_is_no_estimate_near_a_singularity(panda_model: RobotModel):
    straight = np.zeros(7)  # elbow and wrist stretched: the arm cannot move towards its base
    jacobian = panda_model.ee_jacobian(panda_model.kinematics(straight))
    assert np.linalg.svd(jacobian, compute_uv=False)[-1] < 1e-3
    assert wrench_from_torques(panda_model.hinges, panda_model.mechanism.arm, straight, np.ones(7), 0.01, 0.05) is None
