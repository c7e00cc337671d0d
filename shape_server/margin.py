"""Stability margin: the smallest stiffness of an equilibrium against turns that keep all it is held by, compiled.

The smallest eigenvalue of H theta = lambda h theta with C^T theta = -B y on the rows that hold or push, h the lengths of the
segments: lambda is in N, the energy of a turn of 1 rad along the whole cable is lambda L / 2, and lambda falls to zero at a
fold, as the square root of the distance from it. Block inverse iteration with Rayleigh-Ritz (Parlett 1998, "The Symmetric
Eigenvalue Problem", ch. 14), on the same elimination as a Newton step; an upper bound, whose error is squared by each round.
"""

from __future__ import annotations

import numpy as np

from .band import eliminate
from .border import border_rows
from .jitted import kernel
from .newton import border_columns, fix_gauge, linear_system
from .symmetric import solve_symmetric

MODES = 4
ROUNDS = 6


@kernel
def smallest_stiffness(rod, state, view):  # type: ignore[no-untyped-def]
    """Smallest eigenvalue [N] and its mode (n-1, 3) [rad], of unit size in the sense of sum h |theta|^2 = length."""
    count = len(rod.lengths)
    carried, _, diagonal, upper, beyond = linear_system(rod, state, view)
    fix_gauge(rod, diagonal, 0.0)
    border = border_rows(rod, state, view, (0.0, 0.0), np.inf)
    matrix = border_columns(rod, view, border, carried, diagonal)
    kept = np.array([k for k in range(len(border.element)) if not _is_open(border, state, k)], dtype=np.int64)
    many, modes, size = len(kept), min(MODES, 3 * count), 3 * count
    basis, held = np.empty((size, modes)), np.empty((size, many))
    for j in range(count):
        for k in range(3):
            for i in range(modes):
                basis[3 * j + k, i] = np.cos((1.3 * i + 0.7) * (k + 1) + (i + 1) * 3.0 * j / count)
            for row in range(many):
                held[3 * j + k, row] = matrix[j, k, kept[row]]
    compliance = np.empty((many, many))
    for row in range(many):
        for other in range(many):
            compliance[row, other] = border.compliance[kept[row], kept[other]]
    weights = np.repeat(rod.lengths, 3)
    best = 0.0
    for _ in range(ROUNDS):
        right = np.empty((size, many + modes))
        right[:, :many] = held
        right[:, many:] = weights.reshape(-1, 1) * basis
        eliminate(diagonal, upper, beyond, right.reshape(count, 3, many + modes))
        found = np.ascontiguousarray(right[:, many:])
        if many > 0:
            schur = np.ascontiguousarray(held.T) @ right
            force, _ = solve_symmetric(np.ascontiguousarray(schur[:, :many]) + compliance, np.ascontiguousarray(schur[:, many:]))
            found = found - np.ascontiguousarray(right[:, :many]) @ force
        best, basis = _ritz(basis, found, weights)
    mode = basis[:, 0].copy()
    scale = np.sqrt(rod.length / max((weights * mode**2).sum(), 1e-300))
    return best, (scale * mode).reshape(count, 3)


@kernel
def _is_open(border, state, row):  # type: ignore[no-untyped-def]
    contact, rub = row - len(border.held), (row - len(border.element)) // 2 + len(border.rubs)
    if rub >= 0:
        return not state.sticks[border.rubs[rub]]
    return 0 <= contact < len(border.contacts) and not state.touches[border.contacts[contact]]


@kernel
def _ritz(before, found, weights):  # type: ignore[no-untyped-def]
    """Smallest Ritz value of the inverse A^-1 M over found = A^-1 M before, and a basis ordered by it.

    On the span of `found`: found^T A found = found^T M before, found^T M found.
    """
    heavy = weights.reshape(-1, 1) * found
    mass = np.ascontiguousarray(found.T) @ heavy
    stiffness = np.ascontiguousarray(heavy.T) @ np.ascontiguousarray(before)
    stiffness = 0.5 * (stiffness + stiffness.T)
    values, vectors = np.linalg.eigh(mass)
    scale = np.empty_like(vectors)
    for k in range(len(values)):
        scale[:, k] = vectors[:, k] / np.sqrt(max(values[k], 1e-14 * values[-1]))
    values, turned = np.linalg.eigh(np.ascontiguousarray(scale.T) @ stiffness @ scale)
    order = np.argsort(values)
    return values[order[0]], found @ np.ascontiguousarray((scale @ turned)[:, order])
