"""Elimination where frames are tied to the next but one: the block-pentadiagonal system as a band of scalars, compiled.

The matrix is taken as L D L^T without exchanges, one unknown after the other; by Sylvester's law D has as many negative entries as
the matrix has negative eigenvalues. A row reaches eight columns to its right.
"""

from __future__ import annotations

import numpy as np

from .elimination import factor_and_solve
from .jitted import kernel

WIDTH = 9  # of the band, with the diagonal


@kernel
def eliminate(diagonal, upper, beyond, right):  # type: ignore[no-untyped-def]
    """Solve for all right-hand sides (n-1, 3, m), which become the solutions; block-tridiagonal where `beyond` (n-1, 3, 3) is empty.

    Returns:
        The number of negative eigenvalues.
    """
    if len(beyond) == 0:
        return factor_and_solve(diagonal, upper, right)
    count, many = 3 * len(diagonal), right.shape[2]
    band, flat = _band(diagonal, upper, beyond), right.reshape(count, many)
    negative = 0
    for i in range(count):
        if abs(band[i, 0]) < 1e-14 * abs(diagonal[i // 3, i % 3, i % 3]) + 1e-300:
            band[i, 0] = 1e-14 * abs(diagonal[i // 3, i % 3, i % 3]) + 1e-300
        negative += 1 if band[i, 0] < 0.0 else 0
        for away in range(1, min(WIDTH, count - i)):
            factor = band[i, away] / band[i, 0]
            if factor != 0.0:
                for further in range(away, min(WIDTH, count - i)):
                    band[i + away, further - away] -= factor * band[i, further]
                for k in range(many):
                    flat[i + away, k] -= factor * flat[i, k]
    for i in range(count - 1, -1, -1):
        for k in range(many):
            value = flat[i, k]
            for away in range(1, min(WIDTH, count - i)):
                value -= band[i, away] * flat[i + away, k]
            flat[i, k] = value / band[i, 0]
    return negative


@kernel
def _band(diagonal, upper, beyond):  # type: ignore[no-untyped-def]
    """The upper half of the matrix, (3 (n-1), WIDTH): entry d of row i is that of column i + d."""
    count = len(diagonal)
    out = np.zeros((3 * count, WIDTH))
    for j in range(count):
        for r in range(3):
            for c in range(3):
                if c >= r:
                    out[3 * j + r, c - r] = diagonal[j, r, c]
                if j + 1 < count:
                    out[3 * j + r, 3 + c - r] = upper[j, r, c]
                if j + 2 < count:
                    out[3 * j + r, 6 + c - r] = beyond[j, r, c]
    return out
