"""External torques by a momentum observer of ours over the joint torques that an arm measured."""

import numpy as np

from pretouch.contact.observer import observe, observer_init
from pretouch.imported_data.velocities import pieces
from pretouch.robot.model import RobotModel
from pretouch.types import FloatArray

GRAVITY = np.array([0.0, 0.0, 9.81])
_SETTLED = 5.0
"""Time constants after which the observer has forgotten how it began [1]."""


def observed(
    model: RobotModel, time: FloatArray, q: FloatArray, qd: FloatArray, tau: FloatArray, gain: float, payload: float
) -> FloatArray:
    """External torques (N, n) on the robot [Nm], NaN after each gap until the observer has settled.

    Args:
        model: the arm.
        time: instants (N,) [s].
        q: positions (N, n) [rad].
        qd: velocities (N, n) [rad/s].
        tau: torques (N, n) that drive the joints, gravity in them [Nm].
        gain: of the observer [1/s].
        payload: mass at the end-effector [kg].
    """
    found = np.full_like(tau, np.nan)
    for piece in pieces(time):
        mass, bias, J = _loaded(model, q[piece.start], qd[piece.start], payload, None, 1.0)
        state = observer_init(mass, qd[piece.start])
        for i in range(piece.start + 1, piece.stop):
            dt = time[i] - time[i - 1]
            mass, bias, J = _loaded(model, q[i], qd[i], payload, J, dt)
            state = observe(state, mass, bias, qd[i], tau[i], gain, dt)
            if time[i] - time[piece.start] > _SETTLED / gain:
                found[i] = state.residual
    return found


def _loaded(
    model: RobotModel, q: FloatArray, qd: FloatArray, payload: float, before: FloatArray | None, dt: float
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Mass matrix and bias of an arm with a load, and the Jacobian (3, n) of the load, from that `dt` earlier."""
    bias = np.empty(model.n)
    mass, bias = model.mass_matrix_and_bias(q, qd, bias)
    if not payload:
        return mass, bias, None
    J = model.ee_jacobian(model.kinematics(q))[:3]
    turned = np.zeros(3) if before is None else (J - before) @ qd / dt
    return mass + payload * J.T @ J, bias + payload * J.T @ (turned + GRAVITY), J
