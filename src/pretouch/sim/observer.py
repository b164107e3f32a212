"""External torques from a generalized-momentum observer, and the Cartesian wrench a robot's interface makes of them.

This is the chain an arm with joint torque sensors runs itself at 1 kHz (De Luca and Mattone 2005; Haddadin et al.
2017); the simulation uses it in the robot's place.
"""

from typing import NamedTuple

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import FloatArray


class ObserverState(NamedTuple):
    """Memory of the observer, n joints."""

    residual: FloatArray
    """(n,) estimated external joint torques [Nm]."""
    integral: FloatArray
    """(n,) integral of the modelled rate of change of momentum [Nm s]."""
    mass_matrix: FloatArray
    """(n, n) mass matrix of the last step [kg m^2]."""


def observer_init(mass_matrix: FloatArray, qd: FloatArray) -> ObserverState:
    """Start with zero residual at the given mass matrix (n, n) and joint velocities (n,) [rad/s]."""
    return ObserverState(np.zeros(len(qd)), mass_matrix @ qd, mass_matrix)  # p in the integral, so that r begins at 0


@compiled
def observe(
    state: ObserverState,
    mass_matrix: FloatArray,
    bias: FloatArray,
    qd: FloatArray,
    tau: FloatArray,
    gain: float,
    dt: float,
) -> ObserverState:
    """Advance the observer by one sample of the joint torque sensors.

    With momentum p = M qd, dp/dt = tau + tau_ext + dM/dt qd - bias. The observer's residual r follows tau_ext as a
    first-order low-pass of the given gain. dM/dt is taken from two successive mass matrices, so C is not needed.

    Args:
        state: memory.
        mass_matrix: (n, n) of the model at this sample [kg m^2].
        bias: (n,) Coriolis and gravity torques of the model [Nm].
        qd: (n,) measured joint velocities [rad/s].
        tau: (n,) measured joint torques, friction compensation already subtracted [Nm].
        gain: K_O [1/s], the bandwidth in rad/s.
        dt: time since the last sample [s].

    Returns:
        The new memory, its `residual` positive for torques **by** the environment **on** the robot.
    """
    n = len(qd)
    momentum, rate = np.zeros(n), np.zeros(n)
    for i in range(n):
        for j in range(n):
            momentum[i] += mass_matrix[i, j] * qd[j]
            rate[i] += (mass_matrix[i, j] - state.mass_matrix[i, j]) * qd[j]  # dM/dt qd dt
    # r = K (p - integral of tau - bias + dM/dt qd + r), implicit in r: the discrete low-pass is stable for any gain
    grown = state.integral + (tau - bias) * dt + rate
    residual = gain * (momentum - grown) / (1.0 + gain * dt)
    return ObserverState(residual, grown + residual * dt, mass_matrix)


def wrench_from_torques(
    jacobian: FloatArray, tau_ext: FloatArray, damping: float, smallest_singular_value: float
) -> FloatArray | None:
    """Wrench (6,) at the end-effector [N, Nm] that explains external joint torques, by damped least squares.

    Solves tau_ext = J^T F for F in the frame of the Jacobian (6, n). Returns None where the smallest singular
    value of J is below the given one: there a robot's interface has no estimate.
    """
    # the eigenvalues of J J^T are the squared singular values of J; those that vanish may come out below zero
    squares, vectors = np.linalg.eigh(jacobian @ jacobian.T)
    if squares[0] < smallest_singular_value**2 or squares[0] <= 0:
        return None
    # F = (J J^T + d^2 I)^-1 J tau, by the eigenvectors of J J^T
    return np.asarray(vectors @ ((vectors.T @ (jacobian @ tau_ext)) / (squares + damping**2)))
