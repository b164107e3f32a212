"""What an arm said of itself in free motion, which spans of it can be used."""

from itertools import pairwise

import numpy as np

from pretouch.errors import CalibrationError
from pretouch.traces import JointTrace
from pretouch.types import FloatArray
from pretouch.values import value

LEAST_S = 20.0
"""Shortest free motion that is used [s]: the noise takes as long to be separated from friction."""
LEAST_MOVED_RAD = 0.1
"""A recording is of an arm that moves if a joint turns by this [rad]."""
_GAP_PERIODS, _BRIDGED_S = 3.5, 0.1
"""Samples further apart than both [s] have a gap between them; less is interpolated."""
_HIGHEST_HZ = 250.0
"""Rate above which samples are left out [Hz]: the observer's low-pass leaves nothing up there to learn from."""
_LOWEST_HZ = 40.0


@value
class ArmSamples(JointTrace):
    """What an arm with n joints said of its motion and of the torques on it, by time. T samples."""

    qd: FloatArray | None
    """(T, n) measured joint velocities [rad/s] of the same instants; None where there are none."""
    tau: FloatArray
    """(T, n) external torques on the robot by its environment as estimated [Nm]."""


@value
class Usable:
    """Samples without gaps in each segment, and what was left out."""

    samples: ArmSamples
    segments: tuple[tuple[int, int], ...]
    """First and last-but-one index of each stretch without a gap."""
    notes: tuple[str, ...]

    @property
    def period(self) -> float:
        """Median time between two samples [s]."""
        return float(np.median(np.diff(self.samples.stamp)))


def usable(samples: ArmSamples) -> Usable:
    """Leave out what is no number, thin out what is faster than needed, and part it at gaps.

    CalibrationError for what is too short, too slow or stands still, with what is missing.
    """
    notes = []
    columns = [samples.q, samples.tau] + ([] if samples.qd is None else [samples.qd])
    good = np.isfinite(samples.stamp) & np.all([np.isfinite(c).all(axis=1) for c in columns], axis=0)
    if not good.all():
        notes.append(f"{int((~good).sum())} of {len(good)} samples are not finite numbers and left out.")
    found = samples.at(good)
    if len(found.stamp) < 2:
        raise CalibrationError("There are no two samples with numbers for all joints: give another recording.")
    if (np.diff(found.stamp) <= 0.0).any():
        order = np.append(np.diff(np.maximum.accumulate(found.stamp)) > 0.0, True)
        notes.append(f"{int((~order).sum())} samples do not come after the one before them, and are left out.")
        found = found.at(order)
    found = _told_once(found, notes)
    rate = 1.0 / float(np.median(np.diff(found.stamp)))
    if rate < _LOWEST_HZ:
        raise CalibrationError(
            f"The samples come at {rate:.3g} Hz: what an observer says changes within 20 ms, so record at"
            f" {_LOWEST_HZ:g} Hz or more."
        )
    every = int(np.ceil(rate / _HIGHEST_HZ - 0.05))  # stamps are not exact
    if every > 1:
        notes.append(f"Of {rate:.4g} samples a second every {every}. is used.")
        found = found.at(np.arange(len(found.stamp)) % every == 0)
    period = float(np.median(np.diff(found.stamp)))
    breaks = np.flatnonzero(np.diff(found.stamp) > max(_GAP_PERIODS * period, _BRIDGED_S)) + 1
    edges = [0, *breaks.tolist(), len(found.stamp)]
    segments = tuple((a, b) for a, b in pairwise(edges) if (b - a) * period >= 1.0)
    if len(segments) > 1:
        notes.append(f"There are {len(edges) - 2} gaps; each stretch of 1 s or more is used by itself.")
    _check_motion(found, segments, period)
    return Usable(found, segments, tuple(notes))


def _told_once(found: ArmSamples, notes: list[str]) -> ArmSamples:
    """Leave out states of a moving arm that are the same as the one before them to the last bit: they are old."""
    columns = [found.q, found.tau] + ([] if found.qd is None else [found.qd])
    new = np.append(True, np.any([(np.diff(c, axis=0) != 0.0).any(axis=1) for c in columns], axis=0))
    if new.all() or np.ptp(found.q, axis=0).max() < LEAST_MOVED_RAD:
        return found
    notes.append(f"{int((~new).sum())} of {len(new)} samples repeat the one before them, and are left out.")
    return found.at(new)


def joint_scale(left: FloatArray) -> FloatArray:
    """Robust standard deviation (n,) of samples (N, n)."""
    return np.asarray(1.4826 * np.median(np.abs(left - np.median(left, axis=0)), axis=0)) + 1e-6


def _check_motion(samples: ArmSamples, segments: tuple[tuple[int, int], ...], period: float) -> None:
    seconds = sum(b - a for a, b in segments) * period
    if seconds < LEAST_S:
        raise CalibrationError(
            f"There are {seconds:.1f} s without a gap: record {LEAST_S:g} s or more of free motion, two minutes for"
            " good numbers."
        )
    moved = np.ptp(samples.q, axis=0)
    if moved.max() < LEAST_MOVED_RAD:
        raise CalibrationError(
            f"The arm stands: no joint turns by more than {moved.max():.2g} rad. Friction, masses and ripple show in"
            f" motion only: record an arm whose joints turn by {LEAST_MOVED_RAD:g} rad and more."
        )
