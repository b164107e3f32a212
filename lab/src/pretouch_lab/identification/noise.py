"""What is no noise in an arm's residual, for it looks like a contact; and the noise of the rest.

That is of velocities and torque sensors, how fast it changes, and what joints share.
"""

import numpy as np
from scipy.optimize import minimize_scalar

from pretouch.errors import CalibrationError
from pretouch.sim.plant_params import PlantParams
from pretouch.types import BoolArray, FloatArray
from pretouch.values import value
from pretouch_lab.identification.fit import BLOCK_S, Columns, Fit
from pretouch_lab.identification.samples import Usable, joint_scale

_CONTACT_SIGMAS, _CONTACT_S = 6.0, 0.15
"""A mean over so long [s], so many of its own robust deviations off, is taken for a contact."""
_MARGIN_S = 0.5
"""What is left out before and after a contact as well [s]."""
_MOST_CONTACTS = 0.3
"""Of a recording in which more than this part looks like contacts nothing is identified."""
LAGS = 20
"""Lags of the autocorrelation that are kept."""
_FITTED = 10
_LEAST_BLOCKS = 8
_LEAST_VELOCITY_RAD_S = 1e-5
"""Least noise of measured velocities that is reported [rad/s]."""


def free_samples(found: Usable, fitted: Fit) -> tuple[BoolArray, tuple[tuple[float, float], ...]]:
    """Say which samples (N,) are of free motion, and from when to when [s] something else is.

    What a contact does lasts longer than noise: means over `_CONTACT_S` are compared with how far such means usually
    are off. CalibrationError if too much looks like that.
    """
    s = found.samples
    left = s.tau - fitted.expected
    means = smoothed(found, left, _CONTACT_S)
    inside = np.zeros(len(s.stamp), np.bool_)
    for a, b in found.segments:
        inside[a:b] = True
    off = np.abs(means - np.median(means[inside], axis=0))
    far: BoolArray = np.any(off > _CONTACT_SIGMAS * joint_scale(means[inside]), axis=1)
    used, spans = inside.copy(), []
    for a, b in found.segments:
        times = s.stamp[a:b][far[a:b]]
        for group in np.split(times, np.flatnonzero(np.diff(times) > 2.0 * _MARGIN_S) + 1):
            if len(group):
                begin, end = group[0] - _MARGIN_S, group[-1] + _MARGIN_S
                spans.append((float(begin), float(end)))
                used &= (s.stamp < begin) | (s.stamp > end)
    share = 1.0 - float(used.sum()) / max(int(inside.sum()), 1)
    if share > _MOST_CONTACTS:
        raise CalibrationError(
            f"{100 * share:.0f} % of the recording looks like contacts: nothing may touch the arm while it is"
            " identified. Record free motion, or cut the contacts out."
        )
    return used, tuple(spans)


def smoothed(found: Usable, values: FloatArray, over_s: float) -> FloatArray:
    """Moving means (N, n) within each segment."""
    length = max(round(over_s / found.period), 1)
    means = np.zeros_like(values)
    for a, b in found.segments:
        total = np.cumsum(np.vstack([np.zeros((1, values.shape[1])), values[a:b]]), axis=0)
        ends = np.minimum(np.arange(b - a) + length // 2 + 1, b - a)
        begins = np.maximum(np.arange(b - a) - (length - 1) // 2 - (1 - length % 2), 0)
        means[a:b] = (total[ends] - total[begins]) / (ends - begins)[:, None]
    return means


@value
class Noise:
    """Of n joints."""

    total_nm: FloatArray
    """(n,) robust standard deviation of what the mean leaves [Nm]."""
    torque_nm: FloatArray
    """(n,) standard deviation of the torque sensors' noise before the observer [Nm]."""
    torque_errors_nm: FloatArray
    """(n,) its standard error."""
    velocity_rad_s: float
    """Standard deviation of the velocities' noise [rad/s]; NaN without velocities."""
    velocity_error_rad_s: float
    gain_1_s: float
    """Gain of the observer [1/s] by the autocorrelation alone."""
    gain_error_1_s: float
    correlation: FloatArray
    """(n, n) between the joints, of what the mean leaves."""
    autocorrelation: FloatArray
    """(LAGS + 1, n) of what the mean leaves."""
    left_autocorrelation: FloatArray
    """(LAGS + 1, n) of what the velocities' noise leaves of that."""
    period_s: float
    """Of one lag [s]."""


def noise_of(found: Usable, columns: Columns, fitted: Fit, used: BoolArray, usual: PlantParams) -> Noise:
    """Take the noise apart."""
    total = found.samples.tau - fitted.expected
    left = total - fitted.kicked
    blocks = _blocks(found, left, used, BLOCK_S)
    if len(blocks) < _LEAST_BLOCKS:
        raise CalibrationError(
            f"There are {len(blocks)} stretches of {BLOCK_S:g} s without a break: the noise needs {_LEAST_BLOCKS}."
            " Record longer, along smoother paths, with nothing touching the arm."
        )
    covariance = blocks.mean(axis=0)
    without = (len(blocks) * covariance - blocks) / (len(blocks) - 1)  # each with one block left out: the jackknife
    seen = found.samples.qd is not None
    noise = columns.velocity_noise[used]
    velocity = np.nan
    if seen:  # the derivatives' noise is in what differs, too
        square = float(np.mean(joint_scale(noise) ** 2 - columns.motion[0].speed_noise ** 2))
        velocity = float(np.sqrt(max(square, _LEAST_VELOCITY_RAD_S**2)))
    torque = _torque_noise(covariance[0], velocity, columns, fitted, usual)
    again = np.array([_torque_noise(sample[0], velocity, columns, fitted, usual) for sample in without])
    gains = np.array([_gain_of(sample, found.period, usual) for sample in without])
    return Noise(
        total_nm=joint_scale(total[used]), torque_nm=torque, torque_errors_nm=_jackknife(again),
        velocity_rad_s=velocity, velocity_error_rad_s=1.17 * velocity / np.sqrt(2.0 * noise.size),
        gain_1_s=_gain_of(covariance, found.period, usual), gain_error_1_s=float(_jackknife(gains)),
        correlation=np.atleast_2d(np.corrcoef(total[used].T)),
        autocorrelation=_normalised(_blocks(found, total, used, BLOCK_S).mean(axis=0)),
        left_autocorrelation=_normalised(covariance), period_s=found.period,
    )  # fmt: skip


def _jackknife(again: FloatArray) -> FloatArray:
    """Standard error of what came out with each block (B, ...) left out."""
    return np.asarray(np.sqrt(len(again) - 1.0) * again.std(axis=0))


def _normalised(covariance: FloatArray) -> FloatArray:
    return np.asarray(covariance / np.maximum(covariance[0], 1e-12))


def _blocks(found: Usable, left: FloatArray, used: BoolArray, block_s: float) -> FloatArray:
    """Autocovariances (B, LAGS + 1, n) of blocks that are used whole, about the mean of all [Nm^2]."""
    # what is five deviations off is cut: one outlier would be most of a variance
    bound = 5.0 * joint_scale(left[used])
    centred = np.clip(left - np.median(left[used], axis=0), -bound, bound)
    length, rows = max(round(block_s / found.period), 2 * LAGS), []
    for a, b in found.segments:
        for begin in range(a, b - length - LAGS, length):
            if used[begin : begin + length + LAGS].all():
                first = centred[begin : begin + length]
                rows.append([(first * centred[begin + k : begin + length + k]).mean(axis=0) for k in range(LAGS + 1)])
    return np.array(rows)


def _torque_noise(
    variance: FloatArray, velocity: float, columns: Columns, fitted: Fit, usual: PlantParams
) -> FloatArray:
    """Standard deviation (n,) [Nm] of the torque sensors' noise that leaves such a variance behind the observer.

    A first-order noise of corner a through the discrete low-pass of the observer, alpha = K dt / (1 + K dt), keeps the
    part alpha / (2 - alpha) (1 + rho (1 - alpha)) / (1 - rho (1 - alpha)) of its variance, rho = exp(-a dt). What
    earlier noise of the velocities left in the integral is taken off: K'^2 (M M^T)_jj alpha / (2 - alpha) of it; and
    so is what the noise of the positions' derivatives, which is in what was taken for noise of the velocities, leaves.
    """
    dt, gain = usual.period_s, fitted.gain
    alpha, rho = gain * dt / (1.0 + gain * dt), np.exp(-2.0 * np.pi * usual.torque_noise_hz * dt)
    late = rho * (1.0 - alpha)
    part = alpha / (2.0 - alpha) * (1.0 + late) / (1.0 - late)
    own = np.zeros(len(variance))
    if not np.isnan(velocity):
        unknown = columns.motion[0].speed_noise ** 2
        unknown = unknown * velocity**2 / (unknown + velocity**2)
        shares = velocity**2 * alpha / (2.0 - alpha) + unknown
        own = (alpha / dt) ** 2 * columns.mass_square @ shares
    return np.sqrt(np.maximum(variance - own, 0.0) / part)


def _gain_of(covariance: FloatArray, period: float, usual: PlantParams) -> float:
    """Gain [1/s] whose low-pass of first-order noise has the joints' autocorrelation, all joints counting alike."""
    rho, lag = _normalised(covariance)[1 : _FITTED + 1].mean(axis=1), period * np.arange(1, _FITTED + 1)
    a = 2.0 * np.pi * usual.torque_noise_hz

    def misfit(gain: float) -> float:
        shape = (a * np.exp(-gain * lag) - gain * np.exp(-a * lag)) / (a - gain)
        return float(((rho - shape) ** 2).sum())

    return float(minimize_scalar(misfit, bounds=(5.0, 0.9 * a), method="bounded").x)
