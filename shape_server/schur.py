"""What the block-tridiagonal part leaves over the rows of the border, and the turns that belong to their forces, compiled.

The Newton step needs S = C^T H^-1 C and one solution, not those of all columns. With H = L D L^T, eliminated from the last segment to
the first, a column of C is zero until the elimination comes to the segment that its row is on: all of it begins there, and the columns are
taken in the order in which they do. S is then the sum over the segments of (L^-1 C)^T D^-1 (L^-1 C), each over the columns that have
begun.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .band import eliminate
from .elimination import invert
from .jitted import kernel


class Schur(NamedTuple):
    """The block-tridiagonal part, eliminated."""

    matrix: np.ndarray  # (m, m) S
    right: np.ndarray  # (m,) C^T H^-1 g
    negative: int  # negative eigenvalues of H
    order: np.ndarray  # (m,) int, the columns as they begin
    begun: np.ndarray  # (n-1,) int, how many of them have at each segment
    solved: np.ndarray  # (n-1, 3, m + 1), D^-1 L^-1 of g, then of the columns in that order; of no meaning where one has not begun
    carry: np.ndarray  # (n-1, 3, 3), what a segment takes over from the turn of the one before it


@kernel
def complement(diagonal, upper, beyond, matrix, gradient, last):  # type: ignore[no-untyped-def]
    """Eliminate all segments.

    Args:
        diagonal: (n-1, 3, 3) Blocks of H.
        upper: (n-1, 3, 3)
        beyond: (n-1, 3, 3) Blocks next but one, empty without any; with them see `whole`.
        matrix: (n-1, 3, m) C.
        gradient: (n-1, 3) g.
        last: (m,) int, the last segment at which each column is not zero.
    """
    if len(beyond) > 0:
        return whole(diagonal, upper, beyond, matrix, gradient)
    count, many = len(diagonal), matrix.shape[2]
    order, begun = _begin(last, count)
    total, negative = np.zeros((many + 1, many + 1)), 0
    left, solved, carry = np.empty((2, 3, many + 1)), np.empty((count, 3, many + 1)), np.zeros((count, 3, 3))
    block, inverse = np.empty((3, 3)), np.empty((3, 3))
    for j in range(count - 1, -1, -1):
        here, wide = left[j % 2], 1 + begun[j]
        for r in range(3):
            for c in range(3):
                block[r, c] = diagonal[j, r, c]
            here[r, 0] = gradient[j, r]
            for a in range(1, wide):
                here[r, a] = matrix[j, r, order[a - 1]]
        if j + 1 < count:
            _take_over(carry[j + 1], upper[j], left[(j + 1) % 2], here, block, 1 + begun[j + 1])
        negative += invert(block, inverse)
        if j > 0:
            for r in range(3):
                for c in range(3):
                    carry[j, r, c] = 0.0
                    for k in range(3):
                        carry[j, r, c] += inverse[r, k] * upper[j - 1, c, k]
        _add(inverse, here, solved[j], total, wide)
    rows, right = np.empty((many, many)), np.empty(many)
    for a in range(many):
        right[order[a]] = total[a + 1, 0]
        for b in range(a + 1):
            rows[order[a], order[b]] = rows[order[b], order[a]] = total[a + 1, b + 1]
    return Schur(rows, right, negative, order, begun, solved, carry)


@kernel
def _begin(last, count):  # type: ignore[no-untyped-def]
    """Columns in the order in which they begin, and how many have at each of `count` segments."""
    begun, place, order = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64), np.empty(len(last), dtype=np.int64)
    for segment in last:
        begun[segment] += 1
    for j in range(count - 2, -1, -1):
        place[j] = begun[j + 1]
        begun[j] += begun[j + 1]
    for column in range(len(last)):
        order[place[last[column]]] = column
        place[last[column]] += 1
    return order, begun


@kernel
def _take_over(carry, upper, before, here, block, wide):  # type: ignore[no-untyped-def]
    """Eliminate the segment after this one from its block and its columns."""
    for r in range(3):
        x, y, z = carry[0, r], carry[1, r], carry[2, r]
        for c in range(3):
            block[r, c] -= upper[r, 0] * carry[0, c] + upper[r, 1] * carry[1, c] + upper[r, 2] * carry[2, c]
        for a in range(wide):
            here[r, a] -= x * before[0, a] + y * before[1, a] + z * before[2, a]


@kernel
def _add(inverse, here, solved, total, wide):  # type: ignore[no-untyped-def]
    """Solve one segment, and add it to the lower half of the sum."""
    for r in range(3):
        x, y, z = inverse[r, 0], inverse[r, 1], inverse[r, 2]
        for a in range(wide):
            solved[r, a] = x * here[0, a] + y * here[1, a] + z * here[2, a]
    for a in range(wide):
        x, y, z = here[0, a], here[1, a], here[2, a]
        for b in range(a + 1):
            total[a, b] += x * solved[0, b] + y * solved[1, b] + z * solved[2, b]


@kernel
def whole(diagonal, upper, beyond, matrix, gradient):  # type: ignore[no-untyped-def]
    """The same with every column solved for from its first segment to its last, and nothing to take over."""
    count, many = len(diagonal), matrix.shape[2]
    solved = np.empty((count, 3, many + 1))
    solved[:, :, 0] = gradient
    solved[:, :, 1:] = matrix
    negative = eliminate(diagonal, upper, beyond, solved)
    total = matrix.reshape(3 * count, many).T @ solved.reshape(3 * count, many + 1)
    rows, right = np.ascontiguousarray(total[:, 1:]), np.ascontiguousarray(total[:, 0])
    return Schur(rows, right, negative, np.arange(many), np.full(count, many), solved, np.zeros((count, 3, 3)))


@kernel
def turns(schur, change):  # type: ignore[no-untyped-def]
    """Turns (n-1, 3) [rad] of the segments under `change` (m,) of the forces: H^-1 (C change - g)."""
    solved, carry, begun, given = schur.solved, schur.carry, schur.begun, change[schur.order]
    out = np.empty((len(solved), 3))
    for j in range(len(out)):
        x, y, z = -solved[j, 0, 0], -solved[j, 1, 0], -solved[j, 2, 0]
        for a in range(begun[j]):
            x += solved[j, 0, 1 + a] * given[a]
            y += solved[j, 1, 1 + a] * given[a]
            z += solved[j, 2, 1 + a] * given[a]
        out[j, 0], out[j, 1], out[j, 2] = x, y, z
        if j > 0:
            for r in range(3):
                out[j, r] -= carry[j, r, 0] * out[j - 1, 0] + carry[j, r, 1] * out[j - 1, 1] + carry[j, r, 2] * out[j - 1, 2]
    return out
