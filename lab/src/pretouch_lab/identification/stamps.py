"""Stamps that are off, as those of a busy receiver, recovered from the joints together.

An error of a stamp moves all joints of a sample along their speeds, as no noise of encoders does. So where the
positions are too noisy for a narrow fit, stamps are moved to where the joints say that they were. Errors that last
longer than the fit show in measured velocities: all joints seem faster or slower by the same part.
"""

from dataclasses import replace

import numpy as np

from pretouch.types import FloatArray
from pretouch_lab.identification.motion import HALVES_S, Motion, local_cubic, motions_of
from pretouch_lab.identification.samples import Usable

_ROUNDS = 3
_MOVING_RAD_S = 0.05
"""Slower than this, all joints together, an arm does not tell errors of stamps [rad/s]."""
_LEAST_MOVING = 200
"""Samples of a moving arm that errors of stamps are judged by at least."""
_MEDIAN_SQUARE = 0.455
"""Median of the square of normal noise of variance 1."""
_PACE_HALF_S = 0.13
"""Half the width of the fit that tells how much too fast or slow the stamps go [s]."""
_MOST_PACE = 0.1
"""How much too fast or slow stamps go at most [1]."""


def moved(found: Usable) -> tuple[Usable, list[Motion]]:
    """Estimate the motion of each segment; returns the samples as well, with better stamps if theirs are uneven."""
    s, notes, off_s = found.samples, list(found.notes), 0.0
    spans = [slice(a, b) for a, b in found.segments]
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
        notes.append(f"Stamps are off by {1000.0 * off_s:.2g} ms, by what the joints say together: they are corrected.")
    if motions[0].half_s > HALVES_S[0]:
        notes.append(
            f"The positions' noise is {motions[0].noise.max():.2g} rad: speeds are of fits over"
            f" {2.0 * motions[0].half_s:.2g} s."
        )
    time = s.stamp.copy()
    for span, stamp in zip(spans, stamps, strict=True):
        time[span] = stamp
    return replace(found, samples=replace(s, stamp=time), notes=tuple(notes)), motions


def _stamp_errors(
    stamps: list[FloatArray], positions: list[FloatArray], motions: list[Motion]
) -> tuple[list[FloatArray], float]:
    """Errors (N,) [s] that explain what positions are off along the speed, and their size; 0 where there are none.

    They are believed as far as they exceed what positions are off across the speed, and if most of the noise is theirs.
    """
    n = positions[0].shape[1]
    paths = [motion.between() for motion in motions]
    speeds = [path(time, 1) for path, time in zip(paths, stamps, strict=True)]
    offs = [q - path(time) for q, path, time in zip(positions, paths, stamps, strict=True)]
    speed, off = np.concatenate(speeds), np.concatenate(offs)
    square = np.maximum(np.einsum("ti,ti->t", speed, speed), 1e-12)
    moving = square > _MOVING_RAD_S**2
    nothing = [np.zeros(len(time)) for time in stamps]
    if n < 2 or moving.sum() < _LEAST_MOVING:
        return nothing, 0.0
    error = np.einsum("ti,ti->t", off, speed) / square
    across = off - error[:, None] * speed
    noise = np.median(across[moving] ** 2) * n / (n - 1.0) / _MEDIAN_SQUARE
    variance = float(np.median(error[moving] ** 2 - _MEDIAN_SQUARE * noise / square[moving])) / _MEDIAN_SQUARE
    if variance * float(np.median(square[moving])) < noise:
        return nothing, 0.0
    believed = error * variance * square / (variance * square + noise + 1e-18)
    return np.split(believed, np.cumsum([len(time) for time in stamps])[:-1]), float(np.sqrt(variance))


def _paced(stamps: list[FloatArray], velocities: list[FloatArray], motions: list[Motion]) -> list[FloatArray]:
    """Stretch time where all joints are measured slower than their positions change, and the other way round.

    That is believed as far as it exceeds what the velocities' noise does.
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
    usual = float(np.median(each))  # velocities that are all reported too large are no matter of time
    moving = (np.concatenate(speeds) ** 2).sum(axis=1) > _MOVING_RAD_S**2
    variance = float(np.median((each - usual)[moving] ** 2 - _MEDIAN_SQUARE * own[moving])) / _MEDIAN_SQUARE
    if variance <= 0.0:
        return stamps
    paced = []
    for time, part, error in zip(stamps, pace, spread, strict=True):
        believed = np.clip((part - usual) * variance / (variance + error), -_MOST_PACE, _MOST_PACE)
        paced.append(time[0] + np.append(0.0, np.cumsum(np.diff(time) / (1.0 + 0.5 * (believed[1:] + believed[:-1])))))
    return paced
