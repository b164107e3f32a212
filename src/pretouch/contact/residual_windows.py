"""Windows of the newest residuals, and the means of them that the sequential test holds against contacts."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import FloatArray

LENGTHS = (1, 2, 4, 8, 16, 32)
"""Lengths of the windows [samples]."""
LONGEST = LENGTHS[-1]
_LENGTHS = np.array(LENGTHS)


@compiled
def window_means(ring: FloatArray, at: int, count: int, means: FloatArray) -> int:
    """Write the means (6, n) of the newest 1, 2, ... 32 samples of a ring, and return how many of them are whole.

    `at` is where the next sample goes, `count` how many there are.
    """
    size, n = ring.shape
    total = np.zeros(n)
    taken = whole = 0
    for k in range(len(_LENGTHS)):
        if _LENGTHS[k] > count:
            break
        # a longer window goes on with the sum of the shorter one
        while taken < _LENGTHS[k]:
            taken += 1
            for j in range(n):
                total[j] += ring[(at - taken) % size, j]
        for j in range(n):
            means[k, j] = total[j] / taken
        whole += 1
    return whole
