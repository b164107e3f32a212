"""Small dense linear algebra, written to what is given: NumPy's would cost more than the arithmetic."""

import numpy as np

from pretouch.compiled import compiled
from pretouch.types import FloatArray


@compiled
def factor(S: FloatArray, L: FloatArray) -> bool:
    """Write the lower Cholesky factor of S (n, n) to L, and return whether S is positive definite."""
    n = len(S)
    for j in range(n):
        rest = S[j, j]
        for k in range(j):
            rest -= L[j, k] * L[j, k]
        if not rest > 0.0:
            return False
        pivot = np.sqrt(rest)
        L[j, j] = pivot
        for i in range(j + 1, n):
            rest = S[i, j]
            for k in range(j):
                rest -= L[i, k] * L[j, k]
            L[i, j] = rest / pivot
    return True


@compiled
def forward(L: FloatArray, b: FloatArray, y: FloatArray) -> float:
    """Write y = L^-1 b (n,) and return y . y."""
    square = 0.0
    for i in range(len(b)):
        rest = b[i]
        for k in range(i):
            rest -= L[i, k] * y[k]
        y[i] = rest / L[i, i]
        square += y[i] * y[i]
    return square


@compiled
def backward(L: FloatArray, y: FloatArray, x: FloatArray) -> None:
    """Write x = L^-T y (n,)."""
    for i in range(len(y) - 1, -1, -1):
        rest = y[i]
        for k in range(i + 1, len(y)):
            rest -= L[k, i] * x[k]
        x[i] = rest / L[i, i]
