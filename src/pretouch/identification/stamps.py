"""Stamps that are off, as those of a busy receiver, told by the joints together.

An error of a stamp moves all joints of a sample along their speeds, as no noise of encoders does. So where the
positions are too noisy for a narrow fit, stamps are moved to where the joints say that they were. Errors that last
longer than the fit show in measured velocities: all joints seem faster or slower by the same part.
"""

from dataclasses import replace

import numpy as np

from pretouch.identification.motion import HALVES_S, Motion, local_cubic, motions_of
from pretouch.identification.samples import Usable
from pretouch.types import FloatArray

_ROUNDS = 3
_MOVING_RAD_S = 0.05
"""Slower than this, all joints together, an arm does not tell errors of stamps [rad/s]."""
_LEAST_MOVING = 200
"""Samples of a moving arm that errors of stamps are judged by at least."""
_MEDIAN_SQUARE = 0.455
"""Median of the square of normal noise of variance 1."""
_PACE_HALF_S = 0.13
"""Half the width of the fit that tells how much too fast or slow the stamps go [s]."""
_PACE, _MOST_PACE = 0.05, 0.1
"""How far stamps go too fast or slow, as believed before, and at most [1]."""
_VELOCITY_NOISE_RAD_S = 0.01
"""Of measured velocities, as believed before [rad/s]: 0.007 to 0.010 of a real Panda (field notes)."""


def moved(found: Usable) -> tuple[Usable, list[Motion]]:
    """Estimate the motion of each segment; returns the samples as well, with better stamps if theirs are uneven."""
    s, notes, off_s = found.samples, list(found.notes), 0.0
    spans = [slice(a, b) for a, b in found.segments]
    positions, stamps = [s.q[span] for span in spans], [s.time[span] for span in spans]
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
    time = s.time.copy()
    for span, stamp in zip(spans, stamps, strict=True):
        time[span] = stamp
    return replace(found, samples=replace(s, time=time), notes=tuple(notes)), motions


def _stamp_errors(
    stamps: list[FloatArray], positions: list[FloatArray], motions: list[Motion]
) -> tuple[list[FloatArray], float]:
    """Errors (N,) [s] that explain what positions are off along the speed, and their size; 0 where there are none.

    They are believed as far as they exceed what positions are off across the speed.
    """
    n = positions[0].shape[1]
    paths = [motion.between() for motion in motions]
    speeds = [path(time, 1) for path, time in zip(paths, stamps, strict=True)]
    offs = [q - path(time) for q, path, time in zip(positions, paths, stamps, strict=True)]
    speed, off = np.concatenate(speeds), np.concatenate(offs)
    square = np.maximum(np.einsum("ti,ti->t", speed, speed), 1e-12)
    moving = square > _MOVING_RAD_S**2
    if n < 2 or moving.sum() < _LEAST_MOVING:
        return [np.zeros(len(time)) for time in stamps], 0.0
    error = np.einsum("ti,ti->t", off, speed) / square
    across = off - error[:, None] * speed
    noise = np.median(across[moving] ** 2) * n / (n - 1.0) / _MEDIAN_SQUARE
    variance = max(float(np.median(error[moving] ** 2 - _MEDIAN_SQUARE * noise / square[moving])) / _MEDIAN_SQUARE, 0.0)
    believed = error * variance * square / (variance * square + noise + 1e-18)
    return np.split(believed, np.cumsum([len(time) for time in stamps])[:-1]), float(np.sqrt(variance))


def _paced(stamps: list[FloatArray], velocities: list[FloatArray], motions: list[Motion]) -> list[FloatArray]:
    """Stretch time where all joints are measured slower than their positions change, and the other way round."""
    parts = []
    for time, measured, motion in zip(stamps, velocities, motions, strict=True):
        speed = motion.between()(time, 1)
        products = np.stack([(measured - speed) * speed, speed**2], axis=2).sum(axis=1)
        (sums, _, _), gains = local_cubic(time, products, time, _PACE_HALF_S)
        before = (_VELOCITY_NOISE_RAD_S / _PACE * gains[:, 0]) ** 2
        parts.append(np.clip(sums[:, 0] / (np.maximum(sums[:, 1], 0.0) + before), -_MOST_PACE, _MOST_PACE))
    usual = float(np.median(np.concatenate(parts)))  # velocities that are all told too large are no matter of time
    paced = []
    for time, part in zip(stamps, parts, strict=True):
        steps = np.diff(time) / (1.0 + 0.5 * (part[1:] + part[:-1]) - usual)
        paced.append(time[0] + np.append(0.0, np.cumsum(steps)))
    return paced
