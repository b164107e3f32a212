"""The map from an electrode's signal to a distance, learnt from approaches at known distances."""

from dataclasses import dataclass

import numpy as np

from pretouch.errors import CalibrationError
from pretouch.types import BoolArray, FloatArray

_OFFSETS_M = np.geomspace(0.001, 0.3, 200)
_FAR = 0.2
"""Share of the measurements, the farthest, that tell how loud the signal is with nothing near."""
_FELT = 4.0
"""Times that noise from which on a signal tells something."""
_LEAST = 20
"""Fewest measurements that are felt."""


@dataclass(frozen=True)
class FieldMap:
    """signal = gain / (distance + offset)^power, and what it is worth."""

    gain: float
    offset_m: float
    power: float
    spread_1: float
    """Standard deviation of the distance, as a part of it, over all approaches."""
    noise: float
    """Standard deviation of the signal with nothing near."""
    farthest_m: float
    """Distance at which every approach is still felt."""
    of: dict[str, float]
    """Of each thing that approached, by how much of the distance the map is off: positive where it says too far."""


def learn_map(distance: FloatArray, signal: FloatArray, thing: list[str]) -> FieldMap:
    """Learn the map of N measurements: distances (N,) [m], signals (N,), and what was there.

    The signal with nothing near must have been taken off. A power law of distance and offset is fitted to the logarithm
    of what is felt; every thing counts the same. Raises CalibrationError for what no map can be learnt of.
    """
    if not (np.isfinite(distance).all() and np.isfinite(signal).all() and (distance >= 0).all()):
        raise CalibrationError("A distance or signal is no number, or a distance is negative: correct the table.")
    far = distance >= np.quantile(distance, 1.0 - _FAR)
    noise = 1.4826 * float(np.median(np.abs(signal[far] - np.median(signal[far]))))
    felt = signal > max(_FELT * noise, 0.0)
    near = _felt_within(distance, felt, thing)
    used = felt & (distance <= near) & (distance > 0.0)
    if used.sum() < _LEAST or np.ptp(distance[used]) <= 0.0:
        raise CalibrationError(
            f"Only {int(used.sum())} measurements are felt, {_FELT:g} times above the noise of {noise:.3g}: approach to"
            f" touch, and give at least {_LEAST}, with a fifth of all measured where nothing is felt."
        )
    weight = np.array([1.0 / sum(used[i] for i in range(len(thing)) if thing[i] == name) for name in thing])[used]
    gain, offset, power = _fitted(distance[used], signal[used], weight)
    told = np.maximum(0.0, (gain / signal[used]) ** (1.0 / power) - offset)
    off = told / distance[used] - 1.0
    names = np.array(thing)[used]
    return FieldMap(
        gain, offset, power, float(np.sqrt(np.average(off**2, weights=weight))), noise, near,
        {name: float(np.median(off[names == name])) for name in dict.fromkeys(thing)},
    )  # fmt: skip


def _felt_within(distance: FloatArray, felt: BoolArray, thing: list[str]) -> float:
    """Distance [m] within which at least 19 of 20 measurements of each thing are felt."""
    names, least = np.array(thing), np.inf
    for name in dict.fromkeys(thing):
        own = names == name
        order = np.argsort(distance[own])
        share = np.cumsum(felt[own][order]) / np.arange(1, own.sum() + 1)
        within = np.flatnonzero(share >= 0.95)
        least = min(least, float(distance[own][order][within[-1]]) if len(within) else 0.0)
    return least


def _fitted(distance: FloatArray, signal: FloatArray, weight: FloatArray) -> tuple[float, float, float]:
    """Gain, offset [m] and power of the least weighted squares of log signal, over a grid of offsets."""
    best = (np.inf, 0.0, 0.0, 0.0)
    for offset in _OFFSETS_M:
        slope, level = np.polyfit(np.log(distance + offset), np.log(signal), 1, w=np.sqrt(weight))
        rest = float((weight * (np.log(signal) - level - slope * np.log(distance + offset)) ** 2).sum())
        if slope < 0.0:
            best = min(best, (rest, float(np.exp(level)), float(offset), float(-slope)))
    if not np.isfinite(best[0]):
        raise CalibrationError("The signal does not fall with the distance: check the columns, and the signal's sign.")
    return best[1:]
