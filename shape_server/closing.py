"""The small dense system over the border rows, solved: how held points and contacts are closed together.

After the block-tridiagonal part is eliminated there remains S d = r over the rows, in the order held points, contacts,
curvature. Rows of held points and of curvature are equations. Rows of contacts are complementary: with f the new force,

    f >= 0,   w = (S d - r) >= 0 (the gap after the step),   f w = 0,

a linear complementarity problem over the contacts once the equations are eliminated. It is solved by exchanging all
offending rows at once while their number falls, and the last of them alone where it does not (block principal pivoting
with Murty's rule; Judice and Pires 1994, "A block principal pivoting algorithm for large-scale strictly monotone linear
complementarity problems"), which ends for every stable state. Written so that numba compiles it and numpy runs it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

EXCHANGES_MAX = 200
PATIENCE = 3  # block exchanges allowed without progress
FLOOR = 1e-12  # added to the diagonal of a scaled matrix; a row without any compliance is held this softly


@njit(cache=True)
def close(matrix, right, first_contact, contact_count, push, is_exact):  # type: ignore[no-untyped-def]
    """Change of the force of every row.

    Args:
        matrix: (count, count) S.
        right: (count,) r.
        first_contact: Row of the first contact.
        contact_count: Rows of contacts.
        push: (contact_count,) [N] Forces now acting at the contacts.
        is_exact: Whether contacts are complementary; otherwise their rows are equations like the others.

    Returns:
        change (count,) of the forces, is_closed (contact_count,), and the number of positive eigenvalues of the matrix of all
        rows but those of open contacts.
    """
    count = len(right)
    rows = np.arange(count)
    closed = np.ones(contact_count, dtype=np.bool_)
    change = np.zeros(count)
    free = rows[first_contact : first_contact + contact_count]
    fixed = np.concatenate((rows[:first_contact], rows[first_contact + contact_count :]))
    if is_exact and contact_count > 0:
        coupling = _part(matrix, fixed, free)
        own, rest = _part(matrix, free, free), right[free]
        if len(fixed) > 0:
            both = np.column_stack((coupling, right[fixed]))
            solved = _solve(_part(matrix, fixed, fixed), both)
            own = own - coupling.T @ np.ascontiguousarray(solved[:, :contact_count])
            rest = rest - coupling.T @ np.ascontiguousarray(solved[:, contact_count])
        force = complementary(own, rest + own @ push, push > 0.0)
        closed = force > 0.0
        # An open contact has lost whatever force it had.
        change[free] = force - push
        if len(fixed) > 0:
            left = right[fixed] - coupling @ change[free]
            change[fixed] = _solve(_part(matrix, fixed, fixed), left.reshape(-1, 1))[:, 0]
    elif count > 0:
        change = _solve(matrix, right.reshape(-1, 1))[:, 0]
    kept = np.concatenate((rows[:first_contact], free[closed], rows[first_contact + contact_count :]))
    positive = 0
    if len(kept) > 0:
        positive = int((np.linalg.eigvalsh(_scaled(_part(matrix, kept, kept))[0]) > 0.0).sum())
    return change, closed, positive


@njit(cache=True)
def complementary(matrix, right, guess):  # type: ignore[no-untyped-def]
    """Forces f >= 0 (c,) with w = matrix f - right >= 0 and f w = 0; as near as it came if the matrix is not positive.

    Args:
        matrix: (c, c) symmetric.
        right: (c,).
        guess: (c,) bool, contacts expected to push.
    """
    closed = guess.copy()
    fewest, patience = len(right) + 1, PATIENCE
    tolerance = 1e-12 * np.abs(right).max()
    force = np.zeros(len(right))
    for _ in range(EXCHANGES_MAX):
        force[:] = 0.0
        on = np.flatnonzero(closed)
        if len(on) > 0:
            force[on] = _solve(_part(matrix, on, on), right[on].reshape(-1, 1))[:, 0]
        gap = matrix @ force - right
        wrong = np.flatnonzero((closed & (force < 0.0)) | (~closed & (gap < -tolerance)))
        if len(wrong) == 0:
            return force
        if len(wrong) < fewest:
            fewest, patience = len(wrong), PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong = wrong[-1:]
        closed[wrong] = ~closed[wrong]
    return np.maximum(force, 0.0)


@njit(cache=True)
def _part(matrix, rows, columns):  # type: ignore[no-untyped-def]
    return np.ascontiguousarray(matrix[rows][:, columns])


@njit(cache=True)
def _scaled(matrix):  # type: ignore[no-untyped-def]
    """The matrix with rows and columns scaled to comparable size, which keeps the signs of its eigenvalues; the scale."""
    count = len(matrix)
    scale = np.empty(count)
    largest = np.abs(matrix).max()
    for i in range(count):
        least = max(1e-9 * np.abs(matrix[i]).max(), 1e-30 * largest + 1e-300)
        scale[i] = 1.0 / np.sqrt(max(abs(matrix[i, i]), least))
    scaled = scale.reshape(-1, 1) * matrix * scale
    for i in range(count):
        scaled[i, i] += FLOOR
    return scaled, scale


@njit(cache=True)
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solution (c, k) of a symmetric system whose rows may differ by orders of magnitude."""
    scaled, scale = _scaled(matrix)
    tall = scale.reshape(-1, 1)
    return tall * np.linalg.solve(scaled, tall * right)
