"""Points spread evenly, the same each time."""

import numpy as np

from pretouch.types import FloatArray

_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47, 53, 59, 61, 67, 71, 73, 79, 83, 89, 97, 101)


def spread(count: int, dimensions: int, skip: int = 20) -> FloatArray:
    """Points (count, dimensions) of the unit cube: Halton's sequence after its first `skip` points, and each shifted.

    More dimensions than it has primes for begin anew with them, shifted otherwise.
    """
    index = np.arange(1 + skip, 1 + skip + count)
    columns = [(_reversed_digits(index, _PRIMES[k % len(_PRIMES)]) + 0.618034 * k) % 1.0 for k in range(dimensions)]
    return np.stack(columns, axis=1)


def directions(u: FloatArray) -> FloatArray:
    """Unit vectors (N, 3), even over the sphere, of points (N, 2) of the unit square."""
    z, turn = 2 * u[:, 0] - 1, 2 * np.pi * u[:, 1]
    flat = np.sqrt(np.maximum(0.0, 1 - z * z))
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)


def _reversed_digits(index: np.ndarray, base: int) -> FloatArray:
    """Van der Corput's sequence: the digits of whole numbers (N,), mirrored at the point."""
    value, scale, rest = np.zeros(len(index)), 1.0 / base, index.copy()
    while rest.any():
        value += scale * (rest % base)
        rest //= base
        scale /= base
    return value
