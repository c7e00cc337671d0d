"""What the block-tridiagonal part leaves over the rows of the border, and the turns that belong to their forces, compiled.

The Newton step needs S = C^T H^-1 C + B and one solution, not those of all columns. With H = L D L^T, eliminated from the last segment
to the first, a column of C is zero until the elimination comes to the segment that its row is on: all of it begins there, and the columns
are taken in the order in which they do. S is then the sum over the segments of (L^-1 C)^T D^-1 (L^-1 C), each over the columns that
have begun.

A row of the turn of one segment alone, as every edge that slides brings with it, is eliminated together with that segment: with its column
b, its compliance beta, and phi minus its compliance with the other rows, D and L^-1 C of that segment are followed by one line more,

    [ D    b   ]        [ L^-1 C ]
    [ b^T -beta ],      [ phi    ],

whose pivot is -s with s = b^T D^-1 b + beta.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .band import eliminate
from .elimination import invert
from .fours import add_four, set_four
from .jitted import inlined, kernel

NOT_ZERO = 1e-14  # of its two terms, the least size of s


class Schur(NamedTuple):
    """The block-tridiagonal part, eliminated, with the rows of single segments."""

    kept: np.ndarray  # (k,) int, which rows of the border are left
    matrix: np.ndarray  # (k, k) S
    right: np.ndarray  # (k,) C^T H^-1 g
    negative: int  # negative eigenvalues of what was eliminated
    order: np.ndarray  # (k,) int, which of the rows left the columns of `solved` belong to
    begun: np.ndarray  # (n-1,) int, how many of them have begun at each segment
    solved: np.ndarray  # (n-1, 3, k + 1 or more), D^-1 L^-1 of g, then of the columns; of no meaning where one has not begun
    carry: np.ndarray  # (n-1, 3, 3), what a segment takes over from the turn of the one before it


@kernel
def complement(diagonal, upper, beyond, matrix, gradient, last, is_turn, compliance):  # type: ignore[no-untyped-def]
    """Eliminate all segments.

    Args:
        diagonal: (n-1, 3, 3) Blocks of H.
        upper: (n-1, 3, 3)
        beyond: (n-1, 3, 3) Blocks next but one, empty without any; with them see `whole`.
        matrix: (n-1, 3, m) C.
        gradient: (n-1, 3) g.
        last: (m,) int, the last segment at which each column is not zero.
        is_turn: (m,) bool, rows of one segment alone, which is then `last`.
        compliance: (m, m) B.
    """
    if len(beyond) > 0:
        return whole(diagonal, upper, beyond, matrix, gradient, compliance)
    count = len(diagonal)
    row_of, order, begun = _begin(last, is_turn, count)
    many = len(order)
    room = 4 * ((many + 4) // 4)
    total, negative = np.zeros((many + 1, room)), 0
    left, solved, carry = np.zeros((3, room)), np.empty((count, 3, room)), np.zeros((count, 3, 3))
    block, inverse, turned, phi = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.zeros(many + 1)
    for j in range(count - 1, -1, -1):
        wide, row = 1 + begun[j], row_of[j]
        for r in range(3):
            for c in range(3):
                block[r, c] = diagonal[j, r, c]
            left[r, 0] = gradient[j, r]
            for a in range(1, wide):
                left[r, a] = matrix[j, r, order[a - 1]]
        if j + 1 < count:
            _take_over(carry, upper, solved, j, left, block, 1 + begun[j + 1])
        negative += invert(block, inverse)
        size = 0.0
        if row >= 0:
            size = _give_way((matrix[j, 0, row], matrix[j, 1, row], matrix[j, 2, row]), compliance[row, row], inverse, turned)
            negative += 1 if size > 0.0 else 0
        if j > 0:
            for r in range(3):
                for c in range(3):
                    carry[j, r, c] = 0.0
                    for k in range(3):
                        carry[j, r, c] += inverse[r, k] * upper[j - 1, c, k]
        _solve(inverse, left, solved, j, wide)
        if row >= 0:
            for a in range(1, wide):
                phi[a] = -compliance[row, order[a - 1]]
            _add_line(phi, turned, size, left, solved, j, total, wide)
        _add(left, solved, j, total, wide)
    kept, place = np.sort(order), np.empty(len(last), dtype=np.int64)
    place[kept] = np.arange(many)
    rows, right = np.empty((many, many)), np.empty(many)
    for a in range(many):
        one = place[order[a]]
        right[one] = total[a + 1, 0]
        for b in range(a + 1):
            other = place[order[b]]
            rows[one, other] = rows[other, one] = total[a + 1, b + 1] + compliance[order[a], order[b]]
    return Schur(kept, rows, right, negative, place[order], begun, solved, carry)


@kernel
def _begin(last, is_turn, count):  # type: ignore[no-untyped-def]
    """Which row is eliminated with each of `count` segments, -1 for none; the others as they begin, and how many have at each segment."""
    row_of, begun, place = np.full(count, -1), np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    many = 0
    for row in range(len(last)):
        if is_turn[row] and row_of[last[row]] < 0:
            row_of[last[row]] = row
        else:
            begun[last[row]] += 1
            many += 1
    for j in range(count - 2, -1, -1):
        place[j] = begun[j + 1]
        begun[j] += begun[j + 1]
    order = np.empty(many, dtype=np.int64)
    for row in range(len(last)):
        if row_of[last[row]] != row:
            order[place[last[row]]] = row
            place[last[row]] += 1
    return row_of, order, begun


@inlined
def _take_over(carry, upper, solved, j, left, block, wide):  # type: ignore[no-untyped-def]
    """Eliminate the segment after j from its block and its columns."""
    room = left.shape[1]
    for r in range(3):
        x, y, z = upper[j, r, 0], upper[j, r, 1], upper[j, r, 2]
        for c in range(3):
            block[r, c] -= x * carry[j + 1, 0, c] + y * carry[j + 1, 1, c] + z * carry[j + 1, 2, c]
        for a in range(0, wide, 4):
            add_four(left, r * room + a, solved, 3 * (j + 1) * room + a, room, -x, -y, -z)


@inlined
def _give_way(column, beta, inverse, turned):  # type: ignore[no-untyped-def]
    """Eliminate the line of a row from the inverse of its segment; `turned` (3,) becomes D^-1 b. Returns s."""
    work = 0.0
    for r in range(3):
        turned[r] = inverse[r, 0] * column[0] + inverse[r, 1] * column[1] + inverse[r, 2] * column[2]
        work += column[r] * turned[r]
    least = NOT_ZERO * (abs(work) + abs(beta)) + 1e-300
    size = work + beta if abs(work + beta) > least else least
    for r in range(3):
        for c in range(3):
            inverse[r, c] -= turned[r] * turned[c] / size
    return size


@inlined
def _solve(inverse, left, solved, j, wide):  # type: ignore[no-untyped-def]
    """Solve segment j."""
    room = left.shape[1]
    for r in range(3):
        for a in range(0, wide, 4):
            set_four(solved, (3 * j + r) * room + a, left, a, room, inverse[r, 0], inverse[r, 1], inverse[r, 2])


@inlined
def _add_line(phi, turned, size, left, solved, j, total, wide):  # type: ignore[no-untyped-def]
    """Add what the line of a row adds to the solutions of segment j and to the lower half of the sum; `phi` (k + 1,) are its entries."""
    for a in range(1, wide):
        if phi[a] == 0.0:
            continue
        for b in range(a + 1):
            along = turned[0] * left[0, b] + turned[1] * left[1, b] + turned[2] * left[2, b]
            total[a, b] += phi[a] * (along - phi[b]) / size
        for r in range(3):
            solved[j, r, a] += turned[r] * phi[a] / size


@inlined
def _add(left, solved, j, total, wide):  # type: ignore[no-untyped-def]
    """Add segment j to the lower half of the sum, of which each line is filled up to a multiple of four."""
    room = left.shape[1]
    for a in range(wide):
        for b in range(0, a + 1, 4):
            add_four(total, a * room + b, solved, 3 * j * room + b, room, left[0, a], left[1, a], left[2, a])


@kernel
def whole(diagonal, upper, beyond, matrix, gradient, compliance):  # type: ignore[no-untyped-def]
    """The same with every row kept, every column solved for from its first segment to its last, and nothing to take over."""
    count, many = len(diagonal), matrix.shape[2]
    solved = np.empty((count, 3, many + 1))
    solved[:, :, 0] = gradient
    solved[:, :, 1:] = matrix
    negative = eliminate(diagonal, upper, beyond, solved)
    total = matrix.reshape(3 * count, many).T @ solved.reshape(3 * count, many + 1)
    rows, right, every = total[:, 1:] + compliance, np.ascontiguousarray(total[:, 0]), np.arange(many)
    return Schur(every, rows, right, negative, every, np.full(count, many), solved, np.zeros((count, 3, 3)))


@kernel
def turns(schur, change):  # type: ignore[no-untyped-def]
    """Turns (n-1, 3) [rad] of the segments under `change` (k,) of the forces of the rows left."""
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
