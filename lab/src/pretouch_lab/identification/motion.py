"""Motion of an arm: positions, speeds and accelerations from samples with noise and uneven stamps.

A cubic is fitted to the samples around each instant of a regular grid, with larger weights near it (local polynomial
regression; Savitzky and Golay's filter for evenly spaced samples). Lost samples and errors of stamps only increase the
noise: each estimate is a weighted sum of samples, so its noise follows from theirs. The fit is as narrow as the noise
allows, because a wide fit rounds a path's corners.

An error of a stamp, as from a busy receiver, moves all joints of a sample along their speeds; encoder noise does not.
If the positions are too noisy for a narrow fit, stamps are corrected by all joints together. Errors that last longer
than the fit show in measured velocities: all joints seem faster or slower by the same fraction.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.recording import Usable, joint_scale

GRID_S = 0.01
"""Time between two instants of the estimated motion [s]."""
HALVES_S = (0.06, 0.09, 0.13, 0.18, 0.25)
"""Half widths of the fit to try [s]: cutoffs of about 13 to 3 Hz."""
_LEAST = 6
"""Least number of samples for a cubic; the fit is wider where samples are sparse, as in a gap."""
_SURE_RAD_S, _SURE_RAD_S2 = 0.002, 0.8
"""Target noise of speeds [rad/s] and accelerations [rad/s^2]: a quarter of the noise of an arm's measured velocities,
and a fifth of `_QUICK_RAD_S2`."""
_QUICK_RAD_S2 = 4.0
"""Largest change of a joint's speed [rad/s^2] for an accurate speed; corners of a path exceed it."""
_ROUNDED_RAD_S = 0.005
"""Largest difference from a fit of half the width [rad/s]: half of the noise of measured velocities."""
_SIGMAS = 6.0
"""Largest deviation of noise in standard deviations [1]."""
_DEGREE = 3
_ROUNDS = 3
_MOVING_RAD_S = 0.05
"""Least speed of all joints together that shows errors of stamps [rad/s]."""
_LEAST_MOVING = 200
"""Least number of samples of a moving arm for an estimate of errors of stamps."""
_MEDIAN_SQUARE = 0.455
"""Median of the square of normal noise of variance 1."""
_PACE_HALF_S = 0.13
"""Half width of the fit of the stamps' pace [s]."""
_MOST_PACE = 0.1
"""Largest relative error of the stamps' pace [1]."""


@value
class ArmMotion:
    """Motion of an arm with n joints in one stretch without a gap, at G instants, `GRID_S` apart."""

    at: FloatArray
    """(G,) [s]."""
    q: FloatArray
    """(G, n) [rad]."""
    qd: FloatArray
    """(G, n) [rad/s]."""
    qdd: FloatArray
    """(G, n) [rad/s^2]."""
    quick: BoolArray
    """(G,) true where a speed changes faster than the fit follows, or where samples are too few."""
    half_s: float
    """Half the width of the fit [s]."""
    noise: FloatArray
    """(n,) standard deviation of the positions, errors of stamps included [rad]."""
    speed_noise: FloatArray
    """(n,) typical standard deviation of the speeds [rad/s]."""

    def between(self) -> CubicHermiteSpline:
        """Return positions as a function of time; its derivative is the speeds."""
        return CubicHermiteSpline(self.at, self.q, self.qd)


def motions_of(times: list[FloatArray], positions: list[FloatArray]) -> list[ArmMotion]:
    """Estimate the motion in stretches with stamps (N,) [s] and positions (N, n) [rad], with one width for all."""
    grids = [time[0] + GRID_S * np.arange(int((time[-1] - time[0]) / GRID_S) + 2) for time in times]
    samples = list(zip(times, positions, grids, strict=True))
    noise = position_noise(times, positions, HALVES_S[0])
    for half in HALVES_S:
        fits = [local_cubic(*each, half) for each in samples]
        gain = np.median(np.concatenate([gains for _, gains in fits]), axis=0)
        if noise.max() * gain[1] <= _SURE_RAD_S and noise.max() * gain[2] <= _SURE_RAD_S2:
            break
    narrow = [local_cubic(*each, 0.5 * half)[0][1] for each in samples]
    differs = [speed - fitted[1] for speed, (fitted, _) in zip(narrow, fits, strict=True)]
    allowed = _ROUNDED_RAD_S + _SIGMAS * joint_scale(np.concatenate(differs))
    motions = []
    for at, (fitted, gains), off in zip(grids, fits, differs, strict=True):
        unsure = gains[:, 2, None] * noise  # of the accelerations
        quick = (np.abs(fitted[2]) - 0.5 * _SIGMAS * unsure > _QUICK_RAD_S2) | (unsure > _QUICK_RAD_S2)
        quick = np.any(quick | (np.abs(off) > allowed), axis=1)
        motions.append(ArmMotion(at, fitted[0], fitted[1], fitted[2], quick, half, noise, gain[1] * noise))
    return motions


def position_noise(times: list[FloatArray], positions: list[FloatArray], half: float) -> FloatArray:
    """Return the robust standard deviation (n,) [rad] of the noise, from the residuals of a local cubic."""
    rows = []
    for time, q in zip(times, positions, strict=True):
        (fitted, _, _), gains = local_cubic(time, q, time, half)
        rows.append((q - fitted) / np.sqrt(np.maximum(1.0 - 2.0 * gains[:, 3] + gains[:, 0] ** 2, 0.01))[:, None])
    return joint_scale(np.concatenate(rows))


def local_cubic(time: FloatArray, values: FloatArray, at: FloatArray, half: float) -> tuple[FloatArray, FloatArray]:
    """Fit a cubic to the samples around each instant, by weighted least squares.

    Args:
        time: (N,) increasing stamps [s].
        values: (N, c) samples.
        at: (G,) increasing instants [s].
        half: samples nearer than this count [s]; the range grows to include at least `_LEAST` samples.

    Returns:
        Value, first and second derivative (3, G, c), and (G, 4): their standard deviations for samples with a standard
        deviation of 1, and the weight of a sample at the instant itself in the value.
    """
    reach = np.maximum(half, 1.05 * _nearest(time, at))
    first, last = np.searchsorted(time, at - reach), np.searchsorted(time, at + reach)
    size = _DEGREE + 1
    moments, squares = np.zeros((2 * size - 1, len(at))), np.zeros((2 * size - 1, len(at)))
    right = np.zeros((size, len(at), values.shape[1]))
    middle = values[np.clip(first, 0, len(time) - 1)]  # offsets keep the sums accurate
    for k in range(int((last - first).max())):
        there = np.minimum(first + k, len(time) - 1)
        x = (time[there] - at) / reach
        weight = np.where(first + k < last, np.maximum(1.0 - x**2, 0.0) ** 2, 0.0)
        off = values[there] - middle
        power = np.ones(len(at))
        for m in range(2 * size - 1):
            moments[m] += weight * power
            squares[m] += weight**2 * power
            if m < size:
                right[m] += (weight * power)[:, None] * off
            power = power * x
    index = np.add.outer(np.arange(size), np.arange(size))
    inverse = np.linalg.inv(np.moveaxis(moments[index], 2, 0) + 1e-12 * np.eye(size))
    fitted = np.einsum("gij,jgc->igc", inverse, right)
    spread = np.einsum("gij,jkg,gki->gi", inverse, squares[index], inverse)
    scale = np.stack([np.ones(len(at)), 1.0 / reach, 2.0 / reach**2])
    result = fitted[:3] * scale[:, :, None]
    result[0] += middle
    gains = np.sqrt(np.maximum(spread[:, :3], 0.0)) * scale.T
    return result, np.column_stack([gains, inverse[:, 0, 0]])


def _nearest(time: FloatArray, at: FloatArray) -> FloatArray:
    """Return the distances (G,) [s] within which `_LEAST` samples are, or all."""
    count = min(_LEAST, len(time))
    place = np.searchsorted(time, at)
    ways = []
    for k in range(count + 1):
        begin = np.clip(place - k, 0, len(time) - count)
        ways.append(np.maximum(np.abs(time[begin] - at), np.abs(time[begin + count - 1] - at)))
    return np.asarray(np.min(ways, axis=0))


def moved(data: Usable) -> tuple[Usable, list[ArmMotion]]:
    """Estimate the motion of each stretch; return the samples with corrected stamps as well."""
    s, spans, notes, off_s = data.samples, data.stretches, list(data.notes), 0.0
    positions, stamps = [s.q[span] for span in spans], [s.stamp[span] for span in spans]
    motions = motions_of(stamps, positions)
    for _ in range(_ROUNDS):
        if motions[0].half_s == HALVES_S[0]:
            break
        error, off = _stamp_errors(stamps, positions, motions)
        if off == 0.0:
            break
        off_s = max(off_s, off)
        stamps = [np.maximum.accumulate(t + e) for t, e in zip(stamps, error, strict=True)]
        motions = motions_of(stamps, positions)
    if off_s > 0.0 and s.qd is not None:
        stamps = _paced(stamps, [s.qd[span] for span in spans], motions)
        motions = motions_of(stamps, positions)
    if off_s > 0.0:
        notes.append(f"Stamps are off by {1000.0 * off_s:.2g} ms, by all joints together: they are corrected.")
    if motions[0].half_s > HALVES_S[0]:
        notes.append(
            f"The positions' noise is {motions[0].noise.max():.2g} rad: speeds are of fits over"
            f" {2.0 * motions[0].half_s:.2g} s."
        )
    return replace(data, samples=replace(s, stamp=np.concatenate(stamps)), notes=tuple(notes)), motions


def _stamp_errors(
    stamps: list[FloatArray], positions: list[FloatArray], motions: list[ArmMotion]
) -> tuple[list[FloatArray], float]:
    """Return errors of stamps (N,) [s] from position errors along the speed, and their size, 0 without errors.

    They are scaled by their share of the variance: position errors across the speed are noise. If less than half of the
    noise along the speed is theirs, there are none.
    """
    n = positions[0].shape[1]
    paths = [motion.between() for motion in motions]
    speeds = [path(time, 1) for path, time in zip(paths, stamps, strict=True)]
    offs = [q - path(time) for q, path, time in zip(positions, paths, stamps, strict=True)]
    speed, off = np.concatenate(speeds), np.concatenate(offs)
    square = np.maximum(np.einsum("ti,ti->t", speed, speed), 1e-12)
    moving = square > _MOVING_RAD_S**2
    if n < 2 or moving.sum() < _LEAST_MOVING:
        return [], 0.0
    error = np.einsum("ti,ti->t", off, speed) / square
    across = off - error[:, None] * speed
    noise = np.median(across[moving] ** 2) * n / (n - 1.0) / _MEDIAN_SQUARE
    variance = float(np.median(error[moving] ** 2 - _MEDIAN_SQUARE * noise / square[moving])) / _MEDIAN_SQUARE
    if variance * float(np.median(square[moving])) < noise:
        return [], 0.0
    believed = error * variance * square / (variance * square + noise + 1e-18)
    return np.split(believed, np.cumsum([len(time) for time in stamps])[:-1]), float(np.sqrt(variance))


def _paced(stamps: list[FloatArray], velocities: list[FloatArray], motions: list[ArmMotion]) -> list[FloatArray]:
    """Stretch time where all joints are measured slower than their positions change, and compress it if faster.

    The correction is scaled by its share of the variance, beside the velocities' noise.
    """
    speeds = [motion.between()(time, 1) for time, motion in zip(stamps, motions, strict=True)]
    velocity = np.concatenate(velocities) - np.concatenate(speeds)
    noise = float(np.mean(np.median(velocity**2, axis=0)) / _MEDIAN_SQUARE)
    pace, spread = [], []
    for time, measured, speed in zip(stamps, velocities, speeds, strict=True):
        products = np.stack([(measured - speed) * speed, speed**2], axis=2).sum(axis=1)
        (sums, _, _), gains = local_cubic(time, products, time, _PACE_HALF_S)
        square = np.maximum(sums[:, 1], 1e-6)
        pace.append(sums[:, 0] / square)
        spread.append(noise * gains[:, 0] ** 2 / square)
    each, own = np.concatenate(pace), np.concatenate(spread)
    usual = float(np.median(each))  # a constant factor of all velocities is no error of time
    moving = (np.concatenate(speeds) ** 2).sum(axis=1) > _MOVING_RAD_S**2
    variance = float(np.median((each - usual)[moving] ** 2 - _MEDIAN_SQUARE * own[moving])) / _MEDIAN_SQUARE
    if variance <= 0.0:
        return stamps
    paced = []
    for time, part, error in zip(stamps, pace, spread, strict=True):
        believed = np.clip((part - usual) * variance / (variance + error), -_MOST_PACE, _MOST_PACE)
        paced.append(time[0] + np.append(0.0, np.cumsum(np.diff(time) / (1.0 + 0.5 * (believed[1:] + believed[:-1])))))
    return paced
