"""The pose of one IMU on its link, with its errors, by least squares on the manifold of poses.

The model, for a link that moves with w and alpha, and whose origin has the acceleration a (link frame):

    gyroscope      (1 + k_g) * R^T w + b_g
    accelerometer  (1 + k_a) * R^T (a + L p + R_link_base g) + b_a,   L = [alpha]x + [w]x [w]x

with R, p = T_link_sensor, biases b and errors of scale k per axis; read at a clock that is late by an offset, the
accelerometer by a little more than the gyroscope. What holds against gravity, g in the base frame, is an unknown too.
Its magnitude differs by 0.5 % between places: taken as known it would pass for an error of scale, and scale the levers
with it. Its direction differs from the base's z by as much as the arm stands off level: half a degree, taken for none,
would move units by millimetres.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # see `signals`

from pretouch.calibration.link_motion import LinkMotion
from pretouch.calibration.signals import Measured
from pretouch.calibration.values import GRAVITY, RATE_HZ, SCALE_ERROR
from pretouch.types import FloatArray

TURN, PLACE, ACC_BIAS, GYRO_BIAS, CLOCK, LAG = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), 12, 13
ACC_SCALE, GYRO_SCALE, UPWARDS = slice(14, 17), slice(17, 20), slice(20, 23)
"""Slices of the unknowns: rotation in the sensor frame [rad], position in the link frame [m], biases, lags of clock and
accelerometer [s], errors of scale, and the acceleration against gravity, in the base frame [m/s^2]."""
UNKNOWNS = 23
_ACCELERATION_BIAS = 0.4
"""Standard deviation of the accelerometer's constant error, before anything is measured [m/s^2]: 40 mg (LSM6DS3
data sheet, zero-g level offset)."""
_ANGULAR_VELOCITY_BIAS = 0.17
"""The same of the gyroscope [rad/s]: 10 degrees/s (LSM6DS3 data sheet, zero-rate level)."""
_GRAVITY_ERROR = 0.02
"""Its standard deviation [m/s^2]: from 9.780 at the equator to 9.832 at the poles."""
_LEAN_DEG = 1.0
"""Standard deviation of the angle by which the arm's base is off level, towards either side [degrees]."""
_DELAY_DIFFERENCE_S = 0.0005
"""Standard deviation of the delay by which the accelerometer's filter lags behind the gyroscope's [s]."""
_BLOCK_S = 1.0
"""Errors within this time are taken as wholly dependent on each other [s]: the answer's covariance comes from what
blocks of this length say."""
_REWEIGHTINGS = 4
POSE_PRIOR = np.array([np.pi, np.pi, np.pi, 0.5, 0.5, 0.5])
"""Standard deviation of the pose before anything is measured [rad, m]: no unit is further from its link's origin. Only
what a motion does not tell at all depends on it."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Pose and errors of one IMU."""

    R: FloatArray
    """(3, 3) R_link_sensor."""
    p: FloatArray
    """(3,) position in the link frame [m]."""
    errors: FloatArray
    """(23,) the unknowns, by the slices above; those of the pose are 0."""

    def moved(self, x: FloatArray) -> "Estimate":
        """Return the estimate that differs from this one by x (23,): the pose by x on the manifold, the rest is x."""
        R, p = self.R @ scipy.spatial.transform.Rotation.from_rotvec(x[TURN]).as_matrix(), self.p + x[PLACE]
        return Estimate(R, p, np.append(np.zeros(6), x[6:]))

    def specific_force(self, motion: LinkMotion) -> FloatArray:
        """Proper acceleration (N, 3) at the IMU, link frame [m/s^2]."""
        return motion.a + motion.lever @ self.p + motion.R_link_base @ self.errors[UPWARDS]

    def expected(self, motion: LinkMotion) -> FloatArray:
        """Predict the IMU's measurements (N, 6), but for the clock."""
        e = self.errors
        gyro = (motion.w @ self.R) * (1 + e[GYRO_SCALE]) + e[GYRO_BIAS]
        return np.hstack([gyro, self.specific_force(motion) @ self.R * (1 + e[ACC_SCALE]) + e[ACC_BIAS]])

    def differences(self, motion: LinkMotion, measured: Measured) -> FloatArray:
        """Model less measurement (N, 6) [rad/s, m/s^2], the clock's error taken off."""
        late = np.repeat((self.errors[CLOCK], self.errors[CLOCK] + self.errors[LAG]), 3)
        return self.expected(motion) - measured.values - late * measured.rates


def start(motion: LinkMotion, measured: Measured) -> Estimate:
    """Find an estimate in closed form: R from angular velocities (Kabsch), then p and biases, which are linear."""
    w, values = motion.w, measured.values
    U, _, Vt = np.linalg.svd((w - w.mean(axis=0)).T @ (values[:, :3] - values[:, :3].mean(axis=0)))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    # R values = a + R_link_base g + L p + R b, with priors so that what a motion does not tell stays small
    left = np.concatenate([motion.lever, np.broadcast_to(np.eye(3), motion.lever.shape)], axis=2).reshape(-1, 6)
    right = (values[:, 3:] @ R.T - motion.a - GRAVITY * motion.R_link_base[:, :, 2]).reshape(-1)
    solution = np.linalg.solve(left.T @ left + np.diag([1e-2] * 3 + [1e-3] * 3), left.T @ right)
    errors = np.append(np.zeros(UNKNOWNS - 1), GRAVITY)
    errors[ACC_BIAS], errors[GYRO_BIAS] = solution[3:] @ R, values[:, :3].mean(axis=0) - w.mean(axis=0) @ R
    return Estimate(R, solution[:3], errors)


_BIASES = np.repeat([_ACCELERATION_BIAS, _ANGULAR_VELOCITY_BIAS], 3)
_LEAN = np.full(2, GRAVITY * np.deg2rad(_LEAN_DEG))
_PRIOR = np.array(
    [*POSE_PRIOR, *_BIASES, np.inf, _DELAY_DIFFERENCE_S, *np.full(6, SCALE_ERROR), *_LEAN, _GRAVITY_ERROR]
)
"""Standard deviations (23,) of the unknowns before anything is measured."""


class Problem:
    """The least squares for the unknowns x (23,): the pose relative to an estimate, the rest itself."""

    def __init__(self, motion: LinkMotion, measured: Measured, base: Estimate, noise: FloatArray) -> None:
        self.motion, self.measured, self.base, self.noise = motion, measured, base, noise
        self.expected = np.append(np.zeros(UNKNOWNS - 1), GRAVITY)

    def residuals(self, x: FloatArray, weights: FloatArray | float = 1.0) -> FloatArray:
        """Differences from data and priors (6 N + 23,), each divided by its standard deviation, weighted."""
        differences = self.base.moved(x).differences(self.motion, self.measured) / self.noise
        return weights * np.concatenate([differences.reshape(-1), (x - self.expected) / _PRIOR])

    def weights(self, x: FloatArray) -> FloatArray:
        """Roots of the weights by which a large residual counts in proportion to its size only (soft L1)."""
        weights = (1.0 + self.residuals(x) ** 2) ** -0.25
        weights[-UNKNOWNS:] = 1.0
        return weights

    def jacobian(self, x: FloatArray, weights: FloatArray | float = 1.0) -> FloatArray:
        """Return their derivatives (6 N + 23, 23)."""
        motion, N = self.motion, len(self.motion.w)
        e = self.base.moved(x)
        J = np.zeros((N, 6, UNKNOWNS))
        turned = motion.w @ e.R, e.specific_force(motion) @ e.R
        scales = 1 + np.concatenate([e.errors[GYRO_SCALE], e.errors[ACC_SCALE]])
        for half, v in enumerate(turned):
            J[:, 3 * half : 3 * half + 3, TURN] = _skew(v) @ _right_jacobian(x[TURN])
        J[:, 3:, PLACE] = e.R.T @ motion.lever
        J[:, 3:, UPWARDS] = e.R.T @ motion.R_link_base
        J *= scales[:, None]
        for i in range(3):
            J[:, i, GYRO_BIAS.start + i] = J[:, 3 + i, ACC_BIAS.start + i] = 1.0
            J[:, i, GYRO_SCALE.start + i] = turned[0][:, i]
            J[:, 3 + i, ACC_SCALE.start + i] = turned[1][:, i]
        J[:, :, CLOCK] = -self.measured.rates
        J[:, 3:, LAG] = -self.measured.rates[:, 3:]
        J /= self.noise[:, None]
        return np.reshape(weights, (-1, 1)) * np.vstack([J.reshape(-1, UNKNOWNS), np.diag(1 / _PRIOR)])


def _skew(v: FloatArray) -> FloatArray:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3) from the left."""
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    o = np.zeros_like(x)
    return np.stack([o, -z, y, z, o, -x, -y, x, o], axis=-1).reshape(*v.shape[:-1], 3, 3)


def _right_jacobian(turn: FloatArray) -> FloatArray:
    """Right Jacobian (3, 3) of the rotations at a rotation vector (3,) [rad]."""
    angle = float(np.linalg.norm(turn))
    if angle < 1e-6:
        return np.eye(3) - 0.5 * _skew(turn)
    K = _skew(turn / angle)
    return np.eye(3) - (1 - np.cos(angle)) / angle * K + (1 - np.sin(angle) / angle) * K @ K


@dataclass(frozen=True, eq=False)
class Fit:
    """The best estimate, and how sure it is."""

    estimate: Estimate
    covariance: FloatArray
    """(23, 23) of all unknowns; `TURN` and `PLACE` say where the pose is."""
    noise: FloatArray
    """(6,) standard deviation of what the model does not explain [rad/s, m/s^2], by axis."""


def fit(motion: LinkMotion, measured: Measured, begin: Estimate, noise: FloatArray, robust: bool = False) -> Fit:
    """Find the most likely estimate from the motion of a link and its IMU at the same N instants.

    `begin` is an estimate near the right one, `noise` (6,) the standard deviations of angular velocities [rad/s] and
    accelerations [m/s^2]; `robust` lets large differences count less.
    """
    problem = Problem(motion, measured, begin, noise)
    x = begin.errors
    for _ in range(_REWEIGHTINGS if robust else 1):
        weights = problem.weights(x) if robust else np.ones(6 * len(motion.w) + UNKNOWNS)
        # MINPACK: beside other programs the threads of LAPACK, which other methods call, cost ten times as much
        options = {"x_scale": "jac", "method": "lm", "args": (weights,)}
        x = scipy.optimize.least_squares(problem.residuals, x, problem.jacobian, **options).x
    estimate = begin.moved(x)
    spread = np.sqrt(np.mean(estimate.differences(motion, measured) ** 2, axis=0))
    # the unknowns on the manifold at the answer, not at the start
    J = Problem(motion, measured, estimate, noise).jacobian(estimate.errors)
    return Fit(estimate, _covariance(J, problem.residuals(x)), spread)


def _covariance(J: FloatArray, residuals: FloatArray) -> FloatArray:
    """Covariance (23, 23) that holds for errors that depend on each other within blocks of `_BLOCK_S`.

    The usual (J^T J)^-1 takes every residual as independent, and is far too small for errors that a motion repeats. Few
    blocks may agree by chance, so the fewer there are, the more of the usual is added.
    """
    data = len(residuals) - UNKNOWNS
    N = data // 6
    scores = np.einsum("nik,ni->nk", J[:data].reshape(N, 6, UNKNOWNS), residuals[:data].reshape(N, 6))
    blocks = np.add.reduceat(scores, np.arange(0, N, round(_BLOCK_S * RATE_HZ)), axis=0)
    prior = J[data:]
    H, count = J.T @ J, len(blocks)
    inverse = np.linalg.inv(H)
    information = count / max(1, count - UNKNOWNS / 6) * blocks.T @ blocks + prior.T @ prior
    return inverse @ (information + (UNKNOWNS / count) ** 3 * H) @ inverse
