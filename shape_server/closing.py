"""The small dense system over the border rows, solved: how held points and contacts are closed together, compiled.

After the block-tridiagonal part is eliminated there remains S d = r over the rows, in the order held points, contacts,
curvature. Rows of held points and of curvature are equations. Rows of contacts are complementary: with f the new force,

    f >= 0,   w = (S d - r) >= 0 (the gap after the step),   f w = 0,

a linear complementarity problem over the contacts once the equations are eliminated. It is solved by exchanging all
offending rows at once while their number falls, and the last of them alone where it does not (block principal pivoting
with Murty's rule; Judice and Pires 1994, "A block principal pivoting algorithm for large-scale strictly monotone linear
complementarity problems"), which ends for every stable state.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel
from .symmetric import condense, part, solve_symmetric

EXCHANGES_MAX = 200
PATIENCE = 3  # block exchanges allowed without progress


@kernel
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
    closed = np.ones(contact_count, dtype=np.bool_)
    change = np.zeros(count)
    if count == 0:
        return change, closed, 0
    if not is_exact or contact_count == 0:
        solved, positive = solve_symmetric(matrix, right.reshape(count, 1))
        change[:] = solved[:, 0]
        return change, closed, positive
    rows = np.arange(count)
    free = rows[first_contact : first_contact + contact_count]
    fixed = np.concatenate((rows[:first_contact], rows[first_contact + contact_count :]))
    own, rest, solved, positive = condense(matrix, right, fixed, free)
    force, own_positive = complementary(own, rest + own @ push, push > 0.0)
    closed = force > 0.0
    # An open contact has lost whatever force it had.
    change[free] = force - push
    change[fixed] = solved[:, contact_count] - np.ascontiguousarray(solved[:, :contact_count]) @ change[free]
    # The eigenvalues of a matrix have the signs of those of a block and of its Schur complement (Haynsworth 1968).
    return change, closed, positive + own_positive


@kernel
def complementary(matrix, right, guess):  # type: ignore[no-untyped-def]
    """Forces f >= 0 (c,) with w = matrix f - right >= 0 and f w = 0, and the number of positive eigenvalues of the rows that push.

    As near as it came if the matrix is not positive.

    Args:
        matrix: (c, c) symmetric.
        right: (c,).
        guess: (c,) bool, contacts expected to push.
    """
    closed = guess.copy()
    fewest, patience = len(right) + 1, PATIENCE
    tolerance = 1e-12 * np.abs(right).max()
    force, positive = np.zeros(len(right)), 0
    for _ in range(EXCHANGES_MAX):
        force[:] = 0.0
        on, positive = np.flatnonzero(closed), 0
        if len(on) > 0:
            solved, positive = solve_symmetric(part(matrix, on, on), right[on].reshape(-1, 1))
            force[on] = solved[:, 0]
        gap = matrix @ force - right
        wrong = np.flatnonzero((closed & (force <= 0.0)) | (~closed & (gap < -tolerance)))
        if len(wrong) == 0:
            break
        if len(wrong) < fewest:
            fewest, patience = len(wrong), PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong = wrong[-1:]
        closed[wrong] = ~closed[wrong]
    return np.maximum(force, 0.0), positive
