"""Lag of a unit's clock, and agreement of a link's rotation with the unit's gyroscope.

The cross-covariance of two angular velocities is R^T times the covariance of one of them if they are the same but for a
rotation R and a constant: its nuclear norm, divided by both norms, is then 1, whatever R and the gyroscope's bias are.
Its greatest value over all lags tells the clocks' difference.
"""

from dataclasses import dataclass

import numpy as np
import scipy  # see `signals`

from pretouch.types import BoolArray, FloatArray


@dataclass(frozen=True)
class Alignment:
    """The best lag for one link."""

    late: float
    """Lag of the unit's clock [s]."""
    likeness: float
    """Similarity of both angular velocities, 0 to 1."""


def align(
    turning: FloatArray, turned: BoolArray, sensed: FloatArray, sensing: BoolArray, step: float, most: float
) -> Alignment:
    """Find the lag, at most `most` [s] either way, at which a gyroscope measured the rotation of a link.

    `turning` (N, 3) is the angular velocity of the link in its frame, `sensed` (M, 3) that of the sensor in its frame
    [rad/s], both every `step` [s] and from the same instant if the clocks agree; `turned` (N,) and `sensing` (M,) mask
    the known ones.
    """
    a, b = _centred(turning, turned), _centred(sensed, sensing)
    length = scipy.fft.next_fast_len(len(a) + len(b), real=True)
    fa, fb = scipy.fft.rfft(a, length, axis=0), scipy.fft.rfft(b, length, axis=0)
    cross = scipy.fft.irfft(fa.conj()[:, :, None] * fb[:, None, :], length, axis=0)
    # energies of both where they overlap: without them, short overlaps would never win
    energy = np.sqrt(_overlap((a**2).sum(axis=1), sensing, length) * _overlap(turned, (b**2).sum(axis=1), length))
    lags = np.arange(length)
    lags[lags > length - len(a)] -= length
    shared = _overlap(turned, sensing, length)
    # a tenth of the shorter one must overlap, or chance would make two short pieces alike
    fair = (np.abs(lags) * step <= most) & (shared > 0.1 * min(turned.sum(), sensing.sum())) & (energy > 1e-9)
    if not fair.any():
        return Alignment(0.0, 0.0)
    looked = fair | np.roll(fair, 1) | np.roll(fair, -1)  # the peak's neighbours are needed too
    norm = np.linalg.svd(cross[looked], compute_uv=False).sum(axis=1)
    likeness = np.zeros(length)
    likeness[looked] = norm / np.maximum(energy[looked], 1e-9)
    best = int(np.argmax(np.where(fair, likeness, 0.0)))
    return Alignment(float(lags[best] + _peak(likeness, best)) * step, float(min(likeness[best], 1.0)))


def _centred(signal: FloatArray, mask: BoolArray) -> FloatArray:
    mean = signal[mask].mean(axis=0) if mask.any() else 0.0
    return np.where(mask[:, None], signal - mean, 0.0)


def _overlap(first: FloatArray | BoolArray, second: FloatArray | BoolArray, length: int) -> FloatArray:
    """Sums of products at all lags (length,)."""
    a, b = (scipy.fft.rfft(np.asarray(values, np.float64), length) for values in (first, second))
    return np.maximum(scipy.fft.irfft(a.conj() * b, length), 0.0)


def _peak(values: FloatArray, i: int) -> float:
    """Return the offset of the peak of a parabola through three neighbours, in steps."""
    before, at, after = values[i - 1], values[i], values[(i + 1) % len(values)]
    bend = before - 2 * at + after
    return 0.0 if min(before, after) <= 0.0 or bend >= 0.0 else float(0.5 * (before - after) / bend)
