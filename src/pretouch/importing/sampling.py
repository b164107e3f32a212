"""Points spread evenly, the same each time."""

import numpy as np

from pretouch.types import FloatArray


def spread(count: int, dimensions: int, skip: int = 20) -> FloatArray:
    """Points (count, dimensions) of the unit cube: Halton's sequence after its first `skip` points, and each shifted.

    The shift differs between dimensions: the sequence's columns of large primes begin alike.
    """
    from scipy.stats.qmc import Halton  # takes a third of a second, and all that imports this module may never need it

    sequence = Halton(dimensions, scramble=False).fast_forward(1 + skip)
    return (sequence.random(count) + 0.618034 * np.arange(dimensions)) % 1.0


def directions(u: FloatArray) -> FloatArray:
    """Unit vectors (N, 3), even over the sphere, of points (N, 2) of the unit square."""
    z, turn = 2 * u[:, 0] - 1, 2 * np.pi * u[:, 1]
    flat = np.sqrt(np.maximum(0.0, 1 - z * z))
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
