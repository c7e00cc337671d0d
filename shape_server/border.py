"""The border of the system: rows of held points, contacts and curved features, and how they are closed together.

After the block-tridiagonal part is eliminated there remains a small dense system S d = r over the rows. Rows of held points
and of curvature are equations. Rows of contacts are complementary: with f the new force of a contact,

    f >= 0,   w = (S d - r) >= 0 (the gap after the step),   f w = 0,

a linear complementarity problem over the contacts once the equations are eliminated. It is solved by exchanging all
offending rows at once while their number falls, and the last of them alone where it does not (block principal pivoting
with Murty's rule; Judice and Pires 1994, "A block principal pivoting algorithm for large-scale strictly monotone linear
complementarity problems"), which ends for every stable state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

EXCHANGES_MAX: Final = 200
PATIENCE: Final = 3  # block exchanges allowed without progress


@dataclass(frozen=True)
class Closed:
    """Solution of the border system."""

    change: np.ndarray  # (count,) of the forces
    is_closed: np.ndarray  # (contacts,) bool, contacts that push
    positive: int  # positive eigenvalues of the matrix of the closed rows
    row_count: int  # held rows and contacts in that matrix


@dataclass(frozen=True)
class Border:
    """Rows in the order: held points, contacts, curvature."""

    count: int
    element: np.ndarray  # (count,) int
    fraction: np.ndarray  # (count,)
    vector: np.ndarray  # (count, 3)
    is_turn: np.ndarray  # (count,) int
    compliance: np.ndarray  # (count, count)
    residual: np.ndarray  # (count,)
    contacts: np.ndarray  # (c,) int, which contacts have a row
    first_contact: int
    saddles: int  # negative directions that the curvature rows bring with them
    is_exact: bool

    def close(self, matrix: np.ndarray, right: np.ndarray, push: np.ndarray) -> Closed:
        """Solve for the change of every force.

        Args:
            matrix: (count, count) S.
            right: (count,) r.
            push: (m,) [N] Forces now acting at all contacts.
        """
        rows = np.arange(self.count)
        is_contact = (rows >= self.first_contact) & (rows < self.first_contact + len(self.contacts))
        closed = np.ones(len(self.contacts), dtype=bool)
        change = np.zeros(self.count)
        if self.is_exact and len(self.contacts):
            now = push[self.contacts]
            # An open contact has lost whatever force it had.
            fixed, free = rows[~is_contact], rows[is_contact]
            change[free] = -now
            reduced, rest = _eliminated(matrix, right, fixed, free)
            force = complementary(reduced, rest + reduced @ now, now > 0.0)
            closed = force > 0.0
            change[free] = force - now
            if len(fixed):
                change[fixed] = _solve(matrix[np.ix_(fixed, fixed)], right[fixed] - matrix[np.ix_(fixed, free)] @ change[free])
        elif self.count:
            change = _solve(matrix, right)
        kept = np.concatenate(
            [rows[: self.first_contact], self.first_contact + np.flatnonzero(closed), rows[self.first_contact + len(closed) :]]
        )
        return Closed(change, closed, _positive(matrix[np.ix_(kept, kept)]), self.first_contact + int(closed.sum()))


@dataclass(frozen=True)
class Curvature:
    """Rows that carry the curvature of edges and vertices, see `contact_geometry`."""

    contact: list[int]
    vector: np.ndarray  # (rows, 3)
    is_turn: np.ndarray  # (rows,) int
    compliance: np.ndarray  # (rows, rows)
    saddles: int


def curvature_rows(
    slide: np.ndarray, across: np.ndarray, normal: np.ndarray, numbers: np.ndarray, push: np.ndarray, curved: list[int]
) -> Curvature:
    """Rows for the contacts named in `curved`, with the inverse of minus the force times the second derivative as compliance.

    A sliding contact has a block over the rows (a, b_) = (m . dc, n . dt), which brings one negative direction: without a bulge
    it is [[-d, mu], [mu, 0]] / force. Any other row has -d / force.
    """
    contact: list[int] = []
    vector: list[np.ndarray] = []
    turned: list[int] = []
    blocks: list[np.ndarray] = []
    saddles = 0
    for c in curved:
        mu, distance, _, curve = numbers[c]
        bend = distance / push[c]
        if mu != 0.0:
            contact += [c, c]
            vector += [slide[c], normal[c]]
            turned += [0, 1]
            own, cross = curve / mu**2, 1.0 / mu + curve * distance / mu**3
            turn = distance / mu**2 + curve * distance**2 / mu**4
            blocks.append(np.array([[turn, -cross], [-cross, own]]) / (push[c] * (own * turn - cross**2)))
            saddles += 1
        else:
            contact.append(c)
            vector.append(slide[c])
            turned.append(0)
            blocks.append(np.array([[-bend]]))
        if across[c].any():
            contact.append(c)
            vector.append(across[c])
            turned.append(0)
            blocks.append(np.array([[-bend]]))
    compliance = np.zeros((len(contact), len(contact)))
    at = 0
    for block in blocks:
        compliance[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return Curvature(contact, np.array(vector).reshape(-1, 3), np.array(turned, dtype=np.int64), compliance, saddles)


def complementary(matrix: np.ndarray, right: np.ndarray, guess: np.ndarray) -> np.ndarray:
    """Forces f >= 0 (c,) with w = matrix f - right >= 0 and f w = 0; as near as it came if the matrix is not positive.

    Args:
        matrix: (c, c) symmetric.
        right: (c,).
        guess: (c,) bool, contacts expected to push.
    """
    closed = guess.copy()
    fewest, patience = len(right) + 1, PATIENCE
    tolerance = 1e-12 * float(np.abs(right).max(initial=0.0))
    force = np.zeros(len(right))
    for _ in range(EXCHANGES_MAX):
        force[:] = 0.0
        force[closed] = _solve(matrix[np.ix_(closed, closed)], right[closed])
        gap = matrix @ force - right
        wrong = np.flatnonzero((closed & (force < 0.0)) | (~closed & (gap < -tolerance)))
        if not len(wrong):
            return force
        if len(wrong) < fewest:
            fewest, patience = len(wrong), PATIENCE
        elif patience > 0:
            patience -= 1
        else:
            wrong = wrong[-1:]
        closed[wrong] = ~closed[wrong]
    return np.maximum(force, 0.0)


def _eliminated(matrix: np.ndarray, right: np.ndarray, fixed: np.ndarray, free: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and right-hand side of the `free` rows after the `fixed` ones are solved for."""
    own, rest = matrix[np.ix_(free, free)], right[free]
    if not len(fixed):
        return own, rest
    coupling = matrix[np.ix_(fixed, free)]
    solved = _solve(matrix[np.ix_(fixed, fixed)], np.column_stack([coupling, right[fixed]]))
    return own - coupling.T @ solved[:, :-1], rest - coupling.T @ solved[:, -1]


def _solve(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solution of a symmetric system whose rows may differ by orders of magnitude; least squares where it is singular."""
    if not len(matrix):
        return np.zeros_like(right)
    scale = _scale(matrix)
    scaled = scale[:, None] * matrix * scale
    tall = right if right.ndim == 2 else right[:, None]
    try:
        solution = scale[:, None] * np.linalg.solve(scaled, scale[:, None] * tall)
    except np.linalg.LinAlgError:
        solution = scale[:, None] * np.linalg.lstsq(scaled, scale[:, None] * tall, rcond=1e-13)[0]
    return solution.reshape(right.shape)


def _positive(matrix: np.ndarray) -> int:
    """Number of positive eigenvalues of a symmetric matrix."""
    if not len(matrix):
        return 0
    scale = _scale(matrix)  # a congruence, which keeps the signs of the eigenvalues
    return int((np.linalg.eigvalsh(scale[:, None] * matrix * scale) > 0.0).sum())


def _scale(matrix: np.ndarray) -> np.ndarray:
    size = np.abs(matrix)
    least = np.maximum(1e-9 * size.max(axis=1), 1e-30 * size.max() + 1e-300)
    scale: np.ndarray = 1.0 / np.sqrt(np.maximum(np.diag(size), least))
    return scale
