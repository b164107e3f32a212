"""Small dense linear algebra in place: NumPy's functions would cost more than the arithmetic."""

import math

import numpy as np

from pretouch.compiled import kernel
from pretouch.types import FloatArray


@kernel
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


@kernel
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


@kernel
def backward(L: FloatArray, y: FloatArray, x: FloatArray) -> None:
    """Write x = L^-T y (n,)."""
    for i in range(len(y) - 1, -1, -1):
        rest = y[i]
        for k in range(i + 1, len(y)):
            rest -= L[k, i] * x[k]
        x[i] = rest / L[i, i]


@kernel
def largest_eigenvalue(V: FloatArray) -> float:
    """Largest eigenvalue of a symmetric matrix (3, 3): the root of its characteristic polynomial in closed form.

    With q = tr V / 3 and B = (V - q 1) / r, r^2 = tr (V - q 1)^2 / 6, it is q + 2 r cos(arccos(det B / 2) / 3).
    """
    q = (V[0, 0] + V[1, 1] + V[2, 2]) / 3.0
    off = V[0, 1] ** 2 + V[0, 2] ** 2 + V[1, 2] ** 2
    spread = (V[0, 0] - q) ** 2 + (V[1, 1] - q) ** 2 + (V[2, 2] - q) ** 2 + 2.0 * off
    if not spread > 0.0:
        return q
    r = math.sqrt(spread / 6.0)
    x, y, z = (V[0, 0] - q) / r, (V[1, 1] - q) / r, (V[2, 2] - q) / r
    u, v, w = V[0, 1] / r, V[0, 2] / r, V[1, 2] / r
    half = 0.5 * (x * (y * z - w * w) - u * (u * z - w * v) + v * (u * w - y * v))
    # rounding may take it beyond 1
    return q + 2.0 * r * math.cos(math.acos(min(1.0, max(-1.0, half))) / 3.0)
