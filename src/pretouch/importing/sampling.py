"""Points spread evenly, the same each time."""

import numpy as np

from pretouch.types import FloatArray


def directions(u: FloatArray) -> FloatArray:
    """Unit vectors (N, 3), even over the sphere, of points (N, 2) of the unit square."""
    z, turn = 2 * u[:, 0] - 1, 2 * np.pi * u[:, 1]
    flat = np.sqrt(np.maximum(0.0, 1 - z * z))
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=1)
