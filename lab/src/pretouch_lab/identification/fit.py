"""Robust fit of all parts of an arm's residual in free motion, with standard errors.

The residual of a momentum observer of gain K for an arm in free motion is, with L its low-pass,

    r = -L[(1 - c) tau_f(qd)] - offset - L[ripple(q)] + L[masses and payload] + K' M v + noise,

because errors of the torque sensors look like torques of the environment with the opposite sign, and so does the part
(1 - c) of the friction that the interface does not subtract. v is the noise of the measured joint velocities: measured
velocity less the derivative of the positions. It changes the momentum, so that K' = K / (1 + K dt) follows from a
regression. The model is linear except for the friction's shape, F2 and F3: Gauss-Newton, with wide priors that only
determine numbers which the motion does not.

Weights of a Student distribution reduce the influence of outliers. Standard errors are sandwich estimates: the scores
are summed over blocks of 1 s, so that they may be correlated within a block. The priors enter both breads and filling.
"""

import numpy as np
from scipy.signal import lfilter
from scipy.special import expit

from pretouch.contact.residual_model import PLAIN, features_into, features_of
from pretouch.robot.model import RobotModel
from pretouch.sim.plant_params import PlantParams
from pretouch.traces import on_grid
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.motion import GRID_S, ArmMotion
from pretouch_lab.identification.recording import Usable, joint_scale

_FINE_S = 0.001
"""Time step of the low-pass of friction and ripple [s]."""
_REMEMBERED_S = 0.2
"""Time left out after a quick change of speed [s]; an observer of 40 1/s or more has forgotten the change by then."""
OWN = 6
"""Parameters of a joint: offset, friction, ln F2, F3, both parts of the ripple."""
_ROUNDS = 20
_TAILS = 5.0
"""Degrees of freedom of the residuals' Student distribution [1]: outliers have little influence."""
BLOCK_S = 1.0
"""Length of independent blocks [s]: more than ten times the observer's memory."""
_OFFSET_NM, _FRICTION_NM, _RIPPLE_NM = 3.0, 1.0, 0.5
"""Prior standard deviations, wide: of an offset, of the friction that the interface does not compensate, and of each
part of a joint's ripple [Nm]."""
_STEEPNESS, _ASYMMETRY_RAD_S = 0.5, 0.04
"""Prior standard deviations of the logarithm of F2 about its default [1], and of F3 [rad/s]."""
_MASS, _PAYLOAD_KG = 0.1, 0.5
"""Prior standard deviations of the relative error of each link's mass [1], and of the unknown payload [kg]."""
_SETTLED = 1e-2
"""Largest step of a converged fit as a fraction of the prior standard deviations [1]."""
_REACH = 1.0


@value
class Columns:
    """Parts of the model without its parameters: N samples of n joints; F instants 1 ms apart, G `GRID_S` apart."""

    motion: list[ArmMotion]
    """Motion in each stretch."""
    q: list[FloatArray]
    """(F, n) joint positions in each stretch [rad]."""
    speed: list[FloatArray]
    """(F, n) joint velocities there [rad/s]: derivatives of the positions."""
    carried: list[FloatArray]
    """(G, n, n + 1) of each stretch: torque of each joint by weight and inertia of the links behind each joint and of
    1 kg at the end-effector [Nm], before the low-pass."""
    kick: FloatArray
    """(N, n) expected noise of the measured velocities times the mass matrix [kg m^2 rad/s]; 0 without velocities."""
    velocity_noise: FloatArray
    """(N, n) measured velocities less derivatives of positions [rad/s]."""
    mass_square: FloatArray
    """(n, n) mean of the squares of the mass matrix [kg^2 m^4]."""
    calm: BoolArray
    """(N,) true for samples without a quick change of a joint's speed in or shortly before them."""


def columns_of(data: Usable, motions: list[ArmMotion], model: RobotModel) -> Columns:
    """Compute the parts that do not depend on the model's parameters."""
    s, n = data.samples, model.n
    kick, noise, calm = np.zeros(s.q.shape), np.zeros(s.q.shape), np.zeros(len(s.stamp), np.bool_)
    positions, speeds, carried, masses = [], [], [], []
    for span, motion in zip(data.stretches, motions, strict=True):
        time, path = s.stamp[span], motion.between()
        masses.append(np.array([model.mass_matrix(q) for q in motion.q]))
        x = np.empty((len(motion.q), n, features_of(n)))
        for i, (q, qd, qdd) in enumerate(zip(motion.q, motion.qd, motion.qdd, strict=True)):
            features_into(model.kinematics(q), model.mechanism, qd, qdd, x[i])
        carried.append(x[:, :, PLAIN:])
        calm[span] = _calm(motion, time)
        if s.qd is not None:
            growth = on_grid(time, motion.at[0], GRID_S, motion.qdd)
            noise[span] = _noise(s.qd[span], path(time, 1), growth, calm[span])
        fine = np.arange(time[0], time[-1] + 0.5 * _FINE_S, _FINE_S)
        positions.append(path(fine))
        speeds.append(path(fine, 1))
    if s.qd is not None and calm.any():
        # the difference contains the derivatives' noise: on average this share belongs to the velocities
        share = np.maximum(1.0 - (motions[0].speed_noise / joint_scale(noise[calm])) ** 2, 0.0)
        for span, motion, M in zip(data.stretches, motions, masses, strict=True):
            kick[span] = np.einsum("tij,tj->ti", on_grid(s.stamp[span], motion.at[0], GRID_S, M), share * noise[span])
    square = (np.concatenate(masses) ** 2).mean(axis=0)
    return Columns(motions, positions, speeds, carried, kick, noise, square, calm)


def _calm(motion: ArmMotion, time: FloatArray) -> BoolArray:
    """Return flags (N,) of the calm samples of a stretch, without its first ones, in which the low-pass settles."""
    quick = motion.quick.copy()
    quick[: round(_REMEMBERED_S / GRID_S)] = True
    before, after = round(motion.half_s / GRID_S), round(_REMEMBERED_S / GRID_S)
    near = np.convolve(quick, np.ones(before + after + 1))[before : before + len(quick)]
    return np.asarray(near[np.rint((time - motion.at[0]) / GRID_S).astype(np.int64)] < 0.5)


def _noise(measured: FloatArray, speed: FloatArray, growth: FloatArray, calm: BoolArray) -> FloatArray:
    """Return the noise (N, n) of measured velocities: the part that derivatives of the positions do not explain.

    A velocity that is measured late, or at the end of a control period with a constant set-point, has an error
    proportional to the acceleration `growth`. That error is no noise.
    """
    noise = np.zeros_like(speed)
    for j in range(speed.shape[1] if calm.any() else 0):
        explained = np.column_stack([np.ones(len(speed)), speed[:, j], growth[:, j]])
        off = measured[:, j] - speed[:, j]
        noise[:, j] = off - explained @ np.linalg.lstsq(explained[calm], off[calm], rcond=None)[0]
    return noise


def _late(data: Usable, values: list[FloatArray], spacing: float, ahead: list[float], pole: float) -> FloatArray:
    """Low-pass the values (F, ...) of each stretch, `spacing` [s] apart, with one pole; return them at the samples."""
    rows = []
    for span, each in zip(data.stretches, values, strict=True):
        time = data.samples.stamp[span]
        smooth, _ = lfilter(ahead, [1.0, -pole], each, axis=0, zi=(1.0 - ahead[0]) * each[:1])
        rows.append(on_grid(time, time[0], spacing, smooth))
    return np.concatenate(rows)


def carried_late(data: Usable, columns: Columns, gain: float) -> FloatArray:
    """Return `carried` at the samples (N, n, n + 1) after the low-pass, by the trapezoidal rule."""
    half = 0.5 * gain * GRID_S
    return _late(data, columns.carried, GRID_S, 2 * [half / (1.0 + half)], (1.0 - half) / (1.0 + half))


def friction_parts(speed: FloatArray, steepness: FloatArray, asymmetry: FloatArray) -> tuple[FloatArray, ...]:
    """Return the friction for F1 = 1 Nm at joint speeds (F, n), and its derivatives by ln F2 and F3.

    sigma(F2 (qd + F3)) - sigma(F2 F3), the form of Gaz et al. 2019 with sigma the logistic function.
    """
    arm, rest = expit(steepness * (speed + asymmetry)), expit(steepness * asymmetry)
    slope, slope_rest = arm * (1.0 - arm), rest * (1.0 - rest)
    by_steepness = steepness * ((speed + asymmetry) * slope - asymmetry * slope_rest)
    return arm - rest, by_steepness, steepness * (slope - slope_rest)


@value
class ResidualFit:
    """Result of a fit with n joints and p = 6 n + n + 2 parameters."""

    numbers: FloatArray
    """(p,) six of each joint, then the relative errors of the links' masses [1], the payload [kg], and K' [1/s]."""
    errors: FloatArray
    """(p,) standard errors."""
    priors: FloatArray
    """(p,) prior standard deviations."""
    gain: float
    """Gain K of the low-pass [1/s]."""
    expected: FloatArray
    """(N, n) explained torque [Nm], without the part of the velocities' noise."""
    kicked: FloatArray
    """(N, n) torque explained by the velocities' noise [Nm]."""

    @property
    def payload(self) -> tuple[float, float]:
        """The payload and its standard error [kg]."""
        return float(self.numbers[-2]), float(self.errors[-2])

    def of_joints(self, which: FloatArray) -> FloatArray:
        """Return the part of numbers or errors (p,) that belongs to the joints as (n, 6)."""
        n = self.expected.shape[1]
        return which[: OWN * n].reshape(n, OWN)


def fit(data: Usable, columns: Columns, used: BoolArray, usual: PlantParams, payload: bool = True) -> ResidualFit:
    """Fit all parameters to the samples with `used` (N,); without `payload` the payload stays 0."""
    n, cycles = data.samples.q.shape[1], np.array(usual.ripple_cycles)
    start, priors = _begin(n, usual, payload)
    theta, gain = start.copy(), usual.observer_gain_1_s
    kicks = bool(columns.kick.any())
    precision = np.diag(priors**-2.0)
    carried = carried_late(data, columns, gain)
    for _ in range(_ROUNDS):
        X, expected = design(data, columns, carried, theta, gain, cycles)
        left = data.samples.tau - expected - theta[-1] * columns.kick
        scale = joint_scale(left[used])
        weight = (_TAILS + 1.0) / (_TAILS + (left / scale) ** 2) / scale**2 * used[:, None]
        H, g = precision.copy(), precision @ (start - theta)
        for j in range(n):
            weighted = X[:, j] * weight[:, j, None]
            H += weighted.T @ X[:, j]
            g += weighted.T @ left[:, j]
        step = np.linalg.solve(H, g)
        # within the range of the linearised friction's shape
        shape = (step / priors)[: OWN * n].reshape(n, OWN)[:, 2:4]
        step = step / max(float(np.abs(shape).max()) / _REACH, 1.0)
        theta = theta + step
        sure = np.linalg.inv(H)[-1, -1] ** 0.5 < 0.05 * abs(theta[-1])
        new = theta[-1] / (1.0 - theta[-1] * usual.period_s) if kicks and sure and theta[-1] > 0.0 else gain
        if abs(new - gain) > 0.001 * gain:
            carried = carried_late(data, columns, new)
        done, gain = bool(np.all(np.abs(step) < _SETTLED * priors)), new
        if done:
            break
    X, expected = design(data, columns, carried, theta, gain, cycles)
    kicked = theta[-1] * columns.kick
    score = np.einsum("ijp,ij->ip", X, (data.samples.tau - expected - kicked) * weight)
    return ResidualFit(theta, _standard_errors(data, H, precision, score), priors, gain, expected, kicked)


def _begin(n: int, usual: PlantParams, payload: bool) -> tuple[FloatArray, FloatArray]:
    """Return the prior means (p,) and standard deviations (p,)."""
    own, spread = np.zeros((n, OWN)), np.zeros((n, OWN))
    own[:, 1] = (1.0 - usual.friction_compensated) * np.array(usual.friction_f1_nm)
    own[:, 2], own[:, 3] = np.log(usual.friction_f2_s_rad), np.array(usual.friction_f3_rad_s)
    spread[:] = _OFFSET_NM, _FRICTION_NM, _STEEPNESS, _ASYMMETRY_RAD_S, _RIPPLE_NM, _RIPPLE_NM
    shared = np.array([_MASS] * n + [_PAYLOAD_KG if payload else 1e-6, 1e4])
    start = np.concatenate([own.ravel(), np.zeros(n + 1), [usual.observer_gain_1_s]])
    return start, np.concatenate([spread.ravel(), shared])


def design(
    data: Usable, columns: Columns, carried: FloatArray, theta: FloatArray, gain: float, cycles: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives (N, n, p) of the residual by all parameters, and the explained torque (N, n) [Nm]."""
    count, n = data.samples.q.shape
    own = theta[: OWN * n].reshape(n, OWN)
    shapes = []
    for q, speed in zip(columns.q, columns.speed, strict=True):
        friction = friction_parts(speed, np.exp(own[:, 2]), own[:, 3])
        shapes.append(np.stack([*friction, np.sin(cycles * q), np.cos(cycles * q)], axis=1))
    part = gain * _FINE_S / (1.0 + gain * _FINE_S)  # the discretisation of the observer
    late = _late(data, shapes, _FINE_S, [part], 1.0 - part)
    late[:, 1:3] *= own[:, 1]  # derivatives of terms that F1 multiplies
    X = np.zeros((count, n, len(theta)))
    for j in range(n):
        X[:, j, OWN * j] = -1.0
        X[:, j, OWN * j + 1 : OWN * (j + 1)] = -late[:, :, j]
    X[:, :, OWN * n : -1] = carried
    X[:, :, -1] = columns.kick
    linear = theta.copy()
    linear[-1] = 0.0
    linear[: OWN * n].reshape(n, OWN)[:, 2:4] = 0.0
    return X, X @ linear


def _standard_errors(data: Usable, H: FloatArray, precision: FloatArray, score: FloatArray) -> FloatArray:
    """Return standard errors (p,) from the scores (N, p), with the usual correction for the number of blocks."""
    time = data.samples.stamp
    block = ((time - time[0]) / BLOCK_S).astype(np.int64)
    scores = np.zeros((int(block.max()) + 1, score.shape[1]))
    np.add.at(scores, block, score)
    scores = scores[np.bincount(block, minlength=len(scores)) > 0]
    centred = scores - scores.mean(axis=0)
    filling = centred.T @ centred * len(scores) / max(len(scores) - 1, 1) + precision
    bread = np.linalg.inv(H)
    return np.asarray(np.sqrt(np.maximum(np.diag(bread @ filling @ bread), 0.0)))
