"""Points spread evenly, the same each time."""

import numpy as np

from pretouch.types import FloatArray


def spread(count: int, dimensions: int, skip: int = 20) -> FloatArray:
    """Points (count, dimensions) of the unit cube: multiples of an irrational vector after the first (Roberts 2018)."""
    step = 2.0
    for _ in range(40):  # the root of x^(d + 1) = x + 1
        step = (1 + step) ** (1 / (dimensions + 1))
    multiple = np.arange(1 + skip, 1 + skip + count)[:, None]
    return np.asarray(multiple / step ** np.arange(1, dimensions + 1) % 1.0)


def directions(u: FloatArray) -> FloatArray:
    """Unit vectors (N, 3), even over the sphere, of points (N, 2) of the unit square."""
    z, turn = 2 * u[:, 0] - 1, 2 * np.pi * u[:, 1]
    flat = np.sqrt(np.maximum(0.0, 1 - z * z))
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
