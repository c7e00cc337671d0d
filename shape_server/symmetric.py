"""Small dense symmetric systems that need not be definite: solution and inertia from one factorisation, compiled.

L D L^T with complete pivoting and blocks of one or two (Bunch and Parlett 1971, "Direct methods for solving symmetric
indefinite systems of linear equations"); by Sylvester's law the blocks of D have as many positive and negative
eigenvalues as the matrix. Rows are scaled to comparable size first, for forces and curvatures differ by orders of
magnitude.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel

FLOOR = 1e-12  # added to the diagonal of a scaled matrix; a row without any compliance is held this softly
ALPHA = 0.6403882032022076  # (1 + sqrt 17) / 8, the share at which a pivot of one grows the rest as little as one of two


@kernel
def solve_symmetric(matrix, right):  # type: ignore[no-untyped-def]
    """Solution (c, k) of `matrix` (c, c) x = `right` (c, k), and the number of positive eigenvalues of the matrix."""
    count, many = len(matrix), right.shape[1]
    a, scale = _scaled(matrix)
    x = np.empty((count, many))
    for i in range(count):
        for k in range(many):
            x[i, k] = scale[i] * right[i, k]
    order = np.arange(count)
    paired = np.zeros(count, dtype=np.bool_)
    positive, at = 0, 0
    while at < count:
        one, p, q, is_pair = _pivot(a, at)
        if is_pair:
            _swap(a, x, order, at, p)
            _swap(a, x, order, at + 1, q)
            paired[at] = True
            positive += _eliminate_two(a, x, at)
            at += 2
        else:
            _swap(a, x, order, at, one)
            positive += _eliminate_one(a, x, at)
            at += 1
    _substitute_back(a, x, paired)
    out = np.empty((count, many))
    for i in range(count):
        for k in range(many):
            out[order[i], k] = scale[order[i]] * x[i, k]
    return out, positive


@kernel
def _scaled(matrix):  # type: ignore[no-untyped-def]
    """The matrix with rows and columns scaled to comparable size, which keeps the signs of its eigenvalues; the scale."""
    count = len(matrix)
    scale, largest, most = np.empty(count), 0.0, np.zeros(count)
    for i in range(count):
        for j in range(count):
            most[i] = max(most[i], abs(matrix[i, j]))
        largest = max(largest, most[i])
    for i in range(count):
        least = max(1e-9 * most[i], 1e-30 * largest + 1e-300)
        scale[i] = 1.0 / np.sqrt(max(abs(matrix[i, i]), least))
    out = np.empty((count, count))
    for i in range(count):
        for j in range(count):
            out[i, j] = scale[i] * matrix[i, j] * scale[j]
        out[i, i] += FLOOR
    return out, scale


@kernel
def _pivot(a, at):  # type: ignore[no-untyped-def]
    """Best pivot of one, best pair, and whether the pair is to be taken."""
    one, p, q, diagonal, beside = at, at, at, -1.0, -1.0
    for i in range(at, len(a)):
        if abs(a[i, i]) > diagonal:
            one, diagonal = i, abs(a[i, i])
        for j in range(at, i):
            if abs(a[i, j]) > beside:
                p, q, beside = j, i, abs(a[i, j])
    return one, p, q, q > p and diagonal < ALPHA * beside  # no pair of what is not a number


@kernel
def _swap(a, x, order, i, j):  # type: ignore[no-untyped-def]
    if i == j:
        return
    for k in range(len(a)):
        a[i, k], a[j, k] = a[j, k], a[i, k]
    for k in range(len(a)):
        a[k, i], a[k, j] = a[k, j], a[k, i]
    for k in range(x.shape[1]):
        x[i, k], x[j, k] = x[j, k], x[i, k]
    order[i], order[j] = order[j], order[i]


@kernel
def _eliminate_one(a, x, at):  # type: ignore[no-untyped-def]
    """Eliminate with the pivot a[at, at]; multipliers stay in the row `at`. 1 if the pivot is positive."""
    pivot = a[at, at]
    if pivot == 0.0:
        pivot = a[at, at] = FLOOR
    inverse = 1.0 / pivot
    for i in range(at + 1, len(a)):
        factor = a[i, at] * inverse
        if factor != 0.0:
            for j in range(at + 1, len(a)):
                a[i, j] -= factor * a[at, j]
            for k in range(x.shape[1]):
                x[i, k] -= factor * x[at, k]
    return 1 if pivot > 0.0 else 0


@kernel
def _eliminate_two(a, x, at):  # type: ignore[no-untyped-def]
    """Eliminate with the pivot a[at:at+2, at:at+2], which is indefinite: one of its eigenvalues is positive."""
    d, e, f = a[at, at], a[at + 1, at], a[at + 1, at + 1]
    inverse = 1.0 / (d * f - e * e)
    for i in range(at + 2, len(a)):
        first = (a[i, at] * f - a[i, at + 1] * e) * inverse
        second = (a[i, at + 1] * d - a[i, at] * e) * inverse
        for j in range(at + 2, len(a)):
            a[i, j] -= first * a[at, j] + second * a[at + 1, j]
        for k in range(x.shape[1]):
            x[i, k] -= first * x[at, k] + second * x[at + 1, k]
    return 1


@kernel
def _substitute_back(a, x, paired):  # type: ignore[no-untyped-def]
    at = len(a) - 1
    while at >= 0:
        is_pair = at > 0 and paired[at - 1]
        for k in range(x.shape[1]):
            for row in range(at - 1 if is_pair else at, at + 1):
                for j in range(at + 1, len(a)):
                    x[row, k] -= a[row, j] * x[j, k]
            if is_pair:
                d, e, f = a[at - 1, at - 1], a[at, at - 1], a[at, at]
                inverse = 1.0 / (d * f - e * e)
                u, v = x[at - 1, k], x[at, k]
                x[at - 1, k], x[at, k] = (f * u - e * v) * inverse, (d * v - e * u) * inverse
            else:
                x[at, k] /= a[at, at]
        at -= 2 if is_pair else 1
