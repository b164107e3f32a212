"""What each part of an arm's residual looks like over a recording, after the low-pass of the robot's observer."""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from pretouch.contact.residual_model import PLAIN, features
from pretouch.identification.samples import Usable
from pretouch.robot.model import RobotModel
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value

_FINE_S = 0.001
"""Spacing at which friction and ripple are low-passed [s]."""

_QUICK_RAD_S2 = 4.0
"""Where a joint's speed changes faster than this [rad/s^2], as at a corner of a path, samples 10 ms apart do not tell
its speed."""
_AHEAD_S, _REMEMBERED_S = 0.05, 0.2
"""What is left out before and after that [s]; an observer of 40 1/s and more has forgotten it by then."""


@value
class Columns:
    """Of N samples of an arm with n joints; F instants lie 1 ms apart."""

    fine: tuple[FloatArray, ...]
    """Instants of each segment [s]."""
    q: tuple[FloatArray, ...]
    """(F, n) joint positions there [rad]."""
    speed: tuple[FloatArray, ...]
    """(F, n) joint velocities there [rad/s]: derivatives of the positions."""
    carried: FloatArray
    """(N, n, n + 1) torque of each joint by weight and inertia of the links behind each joint and of 1 kg at the
    end-effector [Nm], before the low-pass."""
    kick: FloatArray
    """(N, n) noise of the measured velocities times the mass matrix [kg m^2 rad/s]; 0 without velocities."""
    velocity_noise: FloatArray
    """(N, n) measured velocities less derivatives of positions [rad/s]."""
    mass_square: FloatArray
    """(n,) mean of the diagonal of M M^T [kg^2 m^4]."""
    calm: BoolArray
    """(N,) samples in and shortly before which no joint's speed changes quickly: there its derivative is known."""


def columns_of(found: Usable, model: RobotModel) -> Columns:
    """Work out all that does not depend on what is to be found."""
    s, n = found.samples, model.n
    count = len(s.time)
    carried, kick, noise = np.zeros((count, n, n + 1)), np.zeros((count, n)), np.zeros((count, n))
    square, fine, positions, speeds, calm = np.zeros(n), [], [], [], np.zeros(count, np.bool_)
    for a, b in found.segments:
        spline = CubicSpline(s.time[a:b], s.q[a:b])
        speed, growth = spline(s.time[a:b], 1), spline(s.time[a:b], 2)
        calm[a:b] = _calm(growth, found.period)
        if s.qd is not None:
            noise[a:b] = _noise(s.qd[a:b], speed, growth, calm[a:b])
        for i in range(a, b):
            x = features(model, model.kinematics(s.q[i]), speed[i - a], growth[i - a])
            carried[i] = x[:, PLAIN:]
            M = model.mass_matrix(s.q[i])
            square += np.diag(M @ M.T)
            kick[i] = M @ noise[i]
        at = np.arange(s.time[a], s.time[b - 1] + 0.5 * _FINE_S, _FINE_S)
        fine.append(at)
        positions.append(spline(at))
        speeds.append(spline(at, 1))
    used = sum(b - a for a, b in found.segments)
    return Columns(tuple(fine), tuple(positions), tuple(speeds), carried, kick, noise, square / used, calm)


def _calm(growth: FloatArray, period: float) -> BoolArray:
    """Say which samples (N,) of a segment are calm, and not among its first: there the low-pass still begins."""
    quick: BoolArray = np.any(np.abs(growth) > _QUICK_RAD_S2, axis=1)
    quick[: round(_REMEMBERED_S / period)] = True
    before, after = round(_AHEAD_S / period), round(_REMEMBERED_S / period)
    near = np.convolve(quick, np.ones(before + after + 1))[before : before + len(quick)]
    return np.asarray(near < 0.5)


def _noise(measured: FloatArray, speed: FloatArray, growth: FloatArray, calm: BoolArray) -> FloatArray:
    """Noise (N, n) of measured velocities: what derivatives of the positions, and their growth, do not explain.

    A velocity that is measured late, or at the end of a control period of constant set-point, is off by so much of the
    acceleration: that is no noise.
    """
    off = measured - speed
    noise = np.empty_like(off)
    for j in range(off.shape[1]):
        known = np.column_stack([np.ones(len(off)), speed[:, j], growth[:, j]])
        noise[:, j] = off[:, j] - known @ np.linalg.lstsq(known[calm], off[calm, j], rcond=None)[0]
    return noise


def low_passed(found: Usable, columns: Columns, gain: float, fine_values: list[FloatArray]) -> FloatArray:
    """Low-pass values (F, ...) of each segment as the observer does, and return them at the samples (N, ...)."""
    part = gain * _FINE_S / (1.0 + gain * _FINE_S)
    s = found.samples
    result = np.zeros((len(s.time), *fine_values[0].shape[1:]))
    for (a, b), at, values in zip(found.segments, columns.fine, fine_values, strict=True):
        start = ((1.0 - part) * values[0])[None]
        smooth, _ = lfilter([part], [1.0, part - 1.0], values, axis=0, zi=start)
        place = np.clip((s.time[a:b] - at[0]) / _FINE_S, 0.0, len(at) - 1.000001)
        left = place.astype(np.int64)
        share = (place - left).reshape(-1, *[1] * (values.ndim - 1))
        result[a:b] = (1.0 - share) * smooth[left] + share * smooth[np.minimum(left + 1, len(at) - 1)]
    return result


def carried_late(found: Usable, columns: Columns, gain: float) -> FloatArray:
    """Return `carried` (N, n, n + 1) after the low-pass, by the trapezoidal rule: it changes slowly."""
    late, half = np.zeros_like(columns.carried), 0.5 * gain * found.period
    part, kept = half / (1.0 + half), (1.0 - half) / (1.0 + half)
    for a, b in found.segments:
        values = columns.carried[a:b]
        late[a:b], _ = lfilter([part, part], [1.0, -kept], values, axis=0, zi=((1.0 - part) * values[0])[None])
    return late


def friction_parts(speed: FloatArray, steepness: FloatArray, asymmetry: FloatArray) -> tuple[FloatArray, ...]:
    """Friction of F1 = 1 Nm at joint speeds (F, n), and its derivatives by ln F2 and F3.

    sigma(F2 (qd + F3)) - sigma(F2 F3), the form of Gaz et al. 2019 with sigma the logistic function.
    """
    arm, rest = _logistic(steepness * (speed + asymmetry)), _logistic(steepness * asymmetry)
    slope, slope_rest = arm * (1.0 - arm), rest * (1.0 - rest)
    by_steepness = steepness * ((speed + asymmetry) * slope - asymmetry * slope_rest)
    return arm - rest, by_steepness, steepness * (slope - slope_rest)


def _logistic(x: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * x)))
