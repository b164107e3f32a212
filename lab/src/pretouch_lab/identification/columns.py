"""What each part of an arm's residual looks like over a recording, after the low-pass of the robot's observer."""

import numpy as np
from scipy.signal import lfilter

from pretouch.contact.residual_model import PLAIN, features_into, features_of
from pretouch.robot.model import RobotModel
from pretouch.traces import on_grid
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.motion import GRID_S, Motion
from pretouch_lab.identification.samples import Usable, joint_scale

_FINE_S = 0.001
"""Spacing at which friction and ripple are low-passed [s]."""
_REMEMBERED_S = 0.2
"""What is left out after a speed has changed quickly [s]; an observer of 40 1/s and more has forgotten it by then."""


@value
class Columns:
    """Of N samples of an arm with n joints; F instants lie 1 ms apart, G as those of the motion."""

    motion: tuple[Motion, ...]
    """Of each segment."""
    fine: tuple[FloatArray, ...]
    """Instants (F,) of each segment [s]."""
    q: tuple[FloatArray, ...]
    """(F, n) joint positions there [rad]."""
    speed: tuple[FloatArray, ...]
    """(F, n) joint velocities there [rad/s]: derivatives of the positions."""
    carried: tuple[FloatArray, ...]
    """(G, n, n + 1) of each segment: torque of each joint by weight and inertia of the links behind each joint and of
    1 kg at the end-effector [Nm], before the low-pass."""
    kick: FloatArray
    """(N, n) noise of the measured velocities, as likely as it is, times the mass matrix [kg m^2 rad/s]; 0 without
    velocities."""
    velocity_noise: FloatArray
    """(N, n) measured velocities less derivatives of positions [rad/s]."""
    mass_square: FloatArray
    """(n, n) mean of the squares of the mass matrix [kg^2 m^4]."""
    calm: BoolArray
    """(N,) samples in and shortly before which no joint's speed changes quickly: there its derivative is known."""


def columns_of(found: Usable, motions: list[Motion], model: RobotModel) -> Columns:
    """Work out all that does not depend on what is to be found."""
    s = found.samples
    spans = [slice(a, b) for a, b in found.segments]
    kick, noise, calm = np.zeros(s.q.shape), np.zeros(s.q.shape), np.zeros(len(s.stamp), np.bool_)
    fine, positions, speeds, carried, masses = [], [], [], [], []
    for span, motion in zip(spans, motions, strict=True):
        time, path = s.stamp[span], motion.between()
        M = np.array([model.mass_matrix(q) for q in motion.q])
        masses.append(M)
        x = np.empty((len(motion.q), model.n, features_of(model.n)))
        for i, (q, qd, qdd) in enumerate(zip(motion.q, motion.qd, motion.qdd, strict=True)):
            features_into(model.kinematics(q), model.mechanism, qd, qdd, x[i])
        carried.append(x[:, :, PLAIN:])
        calm[span] = _calm(motion, time)
        if s.qd is not None:
            growth = on_grid(time, motion.at[0], GRID_S, motion.qdd)
            noise[span] = _noise(s.qd[span], path(time, 1), growth, calm[span])
        at = np.arange(time[0], time[-1] + 0.5 * _FINE_S, _FINE_S)
        fine.append(at)
        positions.append(path(at))
        speeds.append(path(at, 1))
    if s.qd is not None and calm.any():
        # part of what differs is the derivatives' own noise: on average this share is the velocities'
        share = np.maximum(1.0 - (motions[0].speed_noise / joint_scale(noise[calm])) ** 2, 0.0)
        for span, motion, M in zip(spans, motions, masses, strict=True):
            kick[span] = np.einsum("tij,tj->ti", on_grid(s.stamp[span], motion.at[0], GRID_S, M), share * noise[span])
    square = (np.concatenate(masses) ** 2).mean(axis=0)
    return Columns(
        tuple(motions), tuple(fine), tuple(positions), tuple(speeds), tuple(carried), kick, noise, square, calm
    )  # fmt: skip


def _calm(motion: Motion, time: FloatArray) -> BoolArray:
    """Say which samples (N,) of a segment are calm, and not among its first: there the low-pass still begins."""
    quick = motion.quick.copy()
    quick[: round(_REMEMBERED_S / GRID_S)] = True
    before, after = round(motion.half_s / GRID_S), round(_REMEMBERED_S / GRID_S)
    near = np.convolve(quick, np.ones(before + after + 1))[before : before + len(quick)]
    return np.asarray(near[np.rint((time - motion.at[0]) / GRID_S).astype(np.int64)] < 0.5)


def _noise(measured: FloatArray, speed: FloatArray, growth: FloatArray, calm: BoolArray) -> FloatArray:
    """Noise (N, n) of measured velocities: what derivatives of the positions, and their growth, do not explain.

    A velocity that is measured late, or at the end of a control period of constant set-point, is off by so much of the
    acceleration: that is no noise.
    """
    off = measured - speed
    noise = np.zeros_like(off)
    if not calm.any():
        return noise
    for j in range(off.shape[1]):
        known = np.column_stack([np.ones(len(off)), speed[:, j], growth[:, j]])
        noise[:, j] = off[:, j] - known @ np.linalg.lstsq(known[calm], off[calm, j], rcond=None)[0]
    return noise


def low_passed(found: Usable, columns: Columns, gain: float, fine_values: list[FloatArray]) -> FloatArray:
    """Low-pass values (F, ...) of each segment as the observer does, and return them at the samples (N, ...)."""
    part = gain * _FINE_S / (1.0 + gain * _FINE_S)
    s = found.samples
    result = np.zeros((len(s.stamp), *fine_values[0].shape[1:]))
    for (a, b), at, values in zip(found.segments, columns.fine, fine_values, strict=True):
        start = ((1.0 - part) * values[0])[None]
        smooth, _ = lfilter([part], [1.0, part - 1.0], values, axis=0, zi=start)
        result[a:b] = on_grid(s.stamp[a:b], at[0], _FINE_S, smooth)
    return result


def carried_late(found: Usable, columns: Columns, gain: float) -> FloatArray:
    """Return `carried` at the samples (N, n, n + 1) after the low-pass, by the trapezoidal rule: it changes slowly."""
    s, half = found.samples, 0.5 * gain * GRID_S
    late = np.zeros((*s.q.shape, s.q.shape[1] + 1))
    part, kept = half / (1.0 + half), (1.0 - half) / (1.0 + half)
    for (a, b), motion, values in zip(found.segments, columns.motion, columns.carried, strict=True):
        smooth, _ = lfilter([part, part], [1.0, -kept], values, axis=0, zi=((1.0 - part) * values[0])[None])
        late[a:b] = on_grid(s.stamp[a:b], motion.at[0], GRID_S, smooth)
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
