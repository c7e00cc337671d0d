"""Small dense symmetric systems that need not be definite: solution and inertia from one factorisation, compiled.

L D L^T with complete pivoting and blocks of one or two (Bunch and Parlett 1971, "Direct methods for solving symmetric
indefinite systems of linear equations"); by Sylvester's law the blocks of D have as many positive and negative
eigenvalues as the matrix. Rows are scaled to comparable size first, for forces and curvatures differ by orders of
magnitude. Of a symmetric array the upper half alone is read and written; given columns stand on its right.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel

FLOOR = 1e-12  # added to the diagonal of a scaled matrix; a row without any compliance is held this softly
ALPHA = 0.6403882032022076  # (1 + sqrt 17) / 8, the share at which a pivot of one grows the rest as little as one of two


@kernel
def solve_symmetric(matrix, right):  # type: ignore[no-untyped-def]
    """Solution (c, k) of `matrix` (c, c) x = `right` (c, k), and the number of positive eigenvalues of the matrix."""
    count, many = right.shape
    scale, a = _scale(matrix), np.empty((count, count + many))
    for i in range(count):
        for j in range(i, count):
            a[i, j] = scale[i] * matrix[i, j] * scale[j]
        a[i, i] += FLOOR
        for k in range(many):
            a[i, count + k] = scale[i] * right[i, k]
    order, paired, positive = _eliminate(a, count)
    return _substitute_back(a, scale, order, paired), positive


@kernel
def condense(matrix, right, fixed, free):  # type: ignore[no-untyped-def]
    """A symmetric system with some of its unknowns eliminated.

    Args:
        matrix: (m, m) symmetric.
        right: (m,)
        fixed: (c,) int, the unknowns to eliminate.
        free: (f,) int, the others.

    Returns:
        Matrix (f, f) and right-hand side (f,) of those that are left, the solution (c, f + 1) of the others for each of the columns that
        couple them with these and for their own right-hand side, and the number of positive eigenvalues of their part of the matrix.
    """
    count, many = len(fixed), len(free)
    own = part(matrix, fixed, fixed)
    scale, a = _scale(own), np.empty((count + many, count + many + 1))
    for i in range(count):
        for j in range(i, count):
            a[i, j] = scale[i] * own[i, j] * scale[j]
        a[i, i] += FLOOR
        for k in range(many):
            a[i, count + k] = scale[i] * matrix[fixed[i], free[k]]
        a[i, count + many] = scale[i] * right[fixed[i]]
    for i in range(many):
        for k in range(i, many):
            a[count + i, count + k] = matrix[free[i], free[k]]
        a[count + i, count + many] = right[free[i]]
    order, paired, positive = _eliminate(a, count)
    left, rest = np.empty((many, many)), np.empty(many)
    for i in range(many):
        for k in range(i, many):
            left[i, k] = left[k, i] = a[count + i, count + k]
        rest[i] = a[count + i, count + many]
    return left, rest, _substitute_back(a, scale, order, paired), positive


@kernel
def part(matrix, rows, columns):  # type: ignore[no-untyped-def]
    """Rows and columns of a matrix, by their numbers."""
    out = np.empty((len(rows), len(columns)))
    for i in range(len(rows)):
        for j in range(len(columns)):
            out[i, j] = matrix[rows[i], columns[j]]
    return out


@kernel
def _scale(matrix):  # type: ignore[no-untyped-def]
    """Factors (c,) that bring rows and columns to comparable size, which keeps the signs of the eigenvalues."""
    count = len(matrix)
    scale, largest = np.empty(count), 0.0
    for i in range(count):
        most = 0.0
        for j in range(count):
            most = max(most, abs(matrix[i, j]))
        scale[i], largest = most, max(largest, most)
    for i in range(count):
        least = max(1e-9 * scale[i], 1e-30 * largest + 1e-300)
        scale[i] = 1.0 / np.sqrt(max(abs(matrix[i, i]), least))
    return scale


@kernel
def _eliminate(a, count):  # type: ignore[no-untyped-def]
    """Eliminate the first `count` unknowns of the upper half of an array, in place.

    Returns:
        Their order, which of them are the first of a pair, and the number of positive eigenvalues of their part.
    """
    order, paired = np.arange(count), np.zeros(count, dtype=np.bool_)
    positive, at = 0, 0
    while at < count:
        one, p, q, is_pair = _pivot(a, at, count)
        if is_pair:
            _swap(a, order, at, p)
            _swap(a, order, at + 1, q)
            paired[at] = True
            positive += _eliminate_two(a, at)
            at += 2
        else:
            _swap(a, order, at, one)
            positive += _eliminate_one(a, at)
            at += 1
    return order, paired, positive


@kernel
def _pivot(a, at, count):  # type: ignore[no-untyped-def]
    """Best pivot of one, best pair, and whether the pair is to be taken."""
    one, p, q, diagonal, beside = at, at, at, -1.0, -1.0
    for i in range(at, count):
        if abs(a[i, i]) > diagonal:
            one, diagonal = i, abs(a[i, i])
        for j in range(i + 1, count):
            if abs(a[i, j]) > beside:
                p, q, beside = i, j, abs(a[i, j])
    return one, p, q, q > p and diagonal < ALPHA * beside  # no pair of what is not a number


@kernel
def _swap(a, order, i, j):  # type: ignore[no-untyped-def]
    """Exchange two unknowns i <= j."""
    if i == j:
        return
    for k in range(i):
        a[k, i], a[k, j] = a[k, j], a[k, i]
    a[i, i], a[j, j] = a[j, j], a[i, i]
    for k in range(i + 1, j):
        a[i, k], a[k, j] = a[k, j], a[i, k]
    for k in range(j + 1, a.shape[1]):
        a[i, k], a[j, k] = a[j, k], a[i, k]
    order[i], order[j] = order[j], order[i]


@kernel
def _eliminate_one(a, at):  # type: ignore[no-untyped-def]
    """Eliminate with the pivot a[at, at]; the multipliers are its row over it. 1 if the pivot is positive."""
    pivot = a[at, at]
    if pivot == 0.0:
        pivot = a[at, at] = FLOOR
    inverse, width = 1.0 / pivot, a.shape[1]
    for i in range(at + 1, len(a)):
        factor = a[at, i] * inverse
        if factor != 0.0:
            for j in range(i, width):
                a[i, j] -= factor * a[at, j]
    return 1 if pivot > 0.0 else 0


@kernel
def _eliminate_two(a, at):  # type: ignore[no-untyped-def]
    """Eliminate with the pivot a[at:at+2, at:at+2], which is indefinite: one of its eigenvalues is positive."""
    d, e, f = a[at, at], a[at, at + 1], a[at + 1, at + 1]
    inverse, width = 1.0 / (d * f - e * e), a.shape[1]
    for i in range(at + 2, len(a)):
        first = (a[at, i] * f - a[at + 1, i] * e) * inverse
        second = (a[at + 1, i] * d - a[at, i] * e) * inverse
        for j in range(i, width):
            a[i, j] -= first * a[at, j] + second * a[at + 1, j]
    return 1


@kernel
def _substitute_back(a, scale, order, paired):  # type: ignore[no-untyped-def]
    """Solutions (c, k) of what was eliminated for each of the columns that stand on its right."""
    count = len(order)
    many = a.shape[1] - count
    out, at = np.empty((count, many)), count - 1
    while at >= 0:
        first = at - 1 if at > 0 and paired[at - 1] else at
        for i in range(first, at + 1):
            for j in range(at + 1, count):
                for k in range(many):
                    a[i, count + k] -= a[i, j] * a[j, count + k]
        d, e, f = a[first, first], a[first, at], a[at, at]
        inverse = 1.0 / (d * f - e * e) if first < at else 1.0 / d
        for k in range(count, count + many):
            u, v = a[first, k], a[at, k]
            if first < at:
                a[first, k], a[at, k] = (f * u - e * v) * inverse, (d * v - e * u) * inverse
            else:
                a[at, k] = u * inverse
        at = first - 1
    for i in range(count):
        for k in range(many):
            out[order[i], k] = scale[order[i]] * a[i, count + k]
    return out
