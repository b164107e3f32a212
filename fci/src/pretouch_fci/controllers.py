"""Controllers in place of the drives' joint impedance: Cartesian impedance, guiding, and external torques."""

import numpy as np

from pretouch.sim.plant import Plant
from pretouch.types import BoolArray, FloatArray
from pretouch_fci.cartesian import ArmBody, difference
from pretouch_fci.limits import PERIOD_S, SLACK

CARTESIAN_STIFFNESS = np.array([3000.0, 3000.0, 3000.0, 300.0, 300.0, 300.0])
"""Along and about the axes of the stiffness frame until it is set [N/m, Nm/rad]: the largest that can be set."""
CARTESIAN_LEAST = np.array([10.0, 10.0, 10.0, 1.0, 1.0, 1.0])
"""The least that can be set, by the vendor's documents."""
JOINT_MOST_NM_RAD = 14250.0
"""The largest stiffness of a joint that can be set, by the same."""
_TORQUE_RATE_NM_S = 1000.0
"""How fast commanded torques may change (libfranka, `rate_limiting.h`)."""


class ExternalTorques:
    """Torques that a client commands."""

    def __init__(self, most: FloatArray, before: FloatArray) -> None:
        """Begin with the torques (7,) that the drives gave before; `most` (7,) are their limits [Nm]."""
        self._most, self._values = most, before
        # The vendor does not say what the first may be: here it may be near what holds the arm now, and near nothing.
        self._near = np.stack([before, np.zeros_like(before)])

    def take(self, torques: FloatArray) -> tuple[str, ...]:
        """Take torques (7,) [Nm], or return the errors: too far from those before, or beyond the limits."""
        with np.errstate(over="ignore"):
            jumps = np.abs(torques - self._near).min(axis=0) > _TORQUE_RATE_NM_S * PERIOD_S * (1 + SLACK)
        violations = {"controller_torque_discontinuity": jumps, "tau_j_range_violation": np.abs(torques) > self._most}
        errors = tuple(name for name, wrong in violations.items() if wrong.any())
        if not errors:
            self._values, self._near = torques, torques[None]
        return errors

    def torques(self) -> FloatArray:
        """Return the last torques (7,) that were taken, without gravity's [Nm]: a lost command leaves them."""
        return self._values


class CartesianImpedance:
    """A spring between end-effector and desired pose; what does not move the end-effector has the joints' springs.

    The vendor does not publish its controller. This one damps each mode of the arm on these springs critically:
    M = L L^T, L^-1 (J^T K J + N K_q N) L^-T = U diag(w^2) U^T, D = L U diag(2 w) U^T L^T.
    """

    def __init__(self, plant: Plant, body: ArmBody, stiffness: FloatArray, joint_stiffness: FloatArray) -> None:
        """Take the arm.

        Args:
            plant: the arm.
            body: its model and end-effector.
            stiffness: (6,) along and about the axes of the stiffness frame [N/m, Nm/rad].
            joint_stiffness: (7,) of the joints, where these do not move the end-effector [Nm/rad].
        """
        self._plant, self._body = plant, body
        self._stiffness, self._joint_stiffness = stiffness, np.diag(joint_stiffness)
        self._rotor = plant.params.armature_kg_m2 * np.eye(plant.model.n)

    def torques(self) -> FloatArray:
        """Return the torques (7,) of springs and dampers, without gravity's [Nm]."""
        data, n = self._plant.mj_data, self._plant.model.n
        q, qd = data.qpos[:n].copy(), data.qvel[:n].copy()
        q_d, qd_d = self._plant.desired
        T, J = self._body.end_effector(q)
        K = self._in_base(T)
        N = np.eye(n) - np.linalg.pinv(J) @ J
        spring = J.T @ K @ difference(self._body.end_effector(q_d)[0], T)
        joints = N @ self._joint_stiffness @ N
        mass_matrix, _ = self._plant.model.mass_matrix_and_bias(q, qd, np.empty(n))
        D = _critical(mass_matrix + self._rotor, J.T @ K @ J + joints)
        return np.asarray(spring + joints @ (q_d - q) + D @ (qd_d - qd))

    def _in_base(self, O_T_EE: FloatArray) -> FloatArray:
        """Return the stiffness (6, 6) along and about the axes of the base."""
        R = O_T_EE[:3, :3] @ self._body.frames.EE_T_K[:3, :3]
        K = np.zeros((6, 6))
        K[:3, :3] = R @ np.diag(self._stiffness[:3]) @ R.T
        K[3:, 3:] = R @ np.diag(self._stiffness[3:]) @ R.T
        return K


def guiding(plant: Plant, body: ArmBody, free: BoolArray) -> CartesianImpedance:
    """Hold the arm where it is but for the axes of the end-effector and the elbow, (7,), that are free."""
    stiffness = np.where(free[:6], 0.0, CARTESIAN_STIFFNESS)
    return CartesianImpedance(plant, body, stiffness, np.where(free[6], 0.0, plant.stiffness))


def _critical(M: FloatArray, K: FloatArray) -> FloatArray:
    """Damping (n, n) with which a mass matrix M (n, n) on springs K (n, n) comes to rest as fast as without swinging.

    Units are those of joints: kg m^2, Nm/rad, Nm s/rad.
    """
    L = np.linalg.cholesky(M)
    whitened = np.linalg.solve(L, np.linalg.solve(L, K).T)
    squares, U = np.linalg.eigh(0.5 * (whitened + whitened.T))
    LU = L @ U
    return np.asarray((LU * (2.0 * np.sqrt(np.maximum(squares, 0.0)))) @ LU.T)
