"""External torques from a generalized-momentum observer, and the Cartesian wrench a robot's interface makes of them.

This is the chain an arm with joint torque sensors runs itself at 1 kHz (De Luca and Mattone 2005; Haddadin et al.
2017); the simulation uses it in the robot's place.
"""

from typing import NamedTuple

import numpy as np

from pretouch.cholesky import backward, factor, forward
from pretouch.compiled import compiled
from pretouch.robot.kinematics import ArmTopology, Hinges, Kinematics, jacobian_into, place
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


@compiled
def wrench_from_torques(
    hinges: Hinges, arm: ArmTopology, q: FloatArray, tau_ext: FloatArray, damping: float, smallest_singular_value: float
) -> FloatArray | None:
    """Wrench (6,) at the end-effector [N, Nm] that explains external joint torques, by damped least squares.

    Solves tau_ext = J^T F, with the Jacobian J (6, n) at joint positions q (n,) [rad], for F in the base frame. Returns
    None where the smallest singular value of J is below the given one: there a robot's interface has no estimate.
    """
    links, n = len(hinges.parent), len(q)
    kin = Kinematics(np.empty((links, 3)), np.empty((links, 3, 3)), np.empty((n, 3)), np.empty((n, 3)))
    place(hinges, q, kin)
    jacobian = np.empty((6, n))
    jacobian_into(kin.anchor, kin.axis, arm.moved_by[arm.ee], kin.position[arm.ee], jacobian)
    square, L, force = np.zeros((6, 6)), np.empty((6, 6)), np.zeros(6)
    for i in range(6):
        for j in range(n):
            force[i] += jacobian[i, j] * tau_ext[j]
            for k in range(6):
                square[i, k] += jacobian[i, j] * jacobian[k, j]
    # all singular values of J are above s where J J^T - s^2 I is positive definite
    for i in range(6):
        square[i, i] -= smallest_singular_value**2
    if not factor(square, L):
        return None
    # F = (J J^T + d^2 I)^-1 J tau
    for i in range(6):
        square[i, i] += smallest_singular_value**2 + damping**2
    factor(square, L)
    forward(L, force, force)
    backward(L, force, force)
    return force
