"""Rows of self-contacts in the border, compiled: each couples two places of one cable; their curvature is that of `strands`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jitted import kernel
from .strands import inner, point_at, shares

WEAK = 1e-9  # of the typical force; a push below it has no curvature
ALONG = 0.02  # squared sine of the angle below which two strands count as side by side, and the first place as staying
LEAST = 1e-3  # of the distance when touching; nearer, the curvature is as there
NEGLIGIBLE = 1e-10  # of the largest eigenvalue of the curvature


class Spread(NamedTuple):
    """Rows that are sums of vectors over the nodes around two places: coef . dr, three nodes each from `node` on."""

    row: np.ndarray  # (r,) int, which row of the border
    node: np.ndarray  # (r, 2) int
    coef: np.ndarray  # (r, 2, 3, 3)


@kernel
def no_spread():  # type: ignore[no-untyped-def]
    """No rows, without curvature."""
    return Spread(np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2, 3, 3))), np.zeros(0)


@kernel
def strand_rows(rod, state, view, contacts, first_row, next_row):  # type: ignore[no-untyped-def]
    """Rows of the self-contacts among `contacts` (c,), whose border rows begin at `first_row`, then those of their curvature.

    Returns:
        The `Spread`, and the stiffness (q,) [N/m] of the curvature rows, which are numbered from `next_row` on.
    """
    strands, many = rod.strands, len(state.push)
    most = 5 * len(strands.distance)
    row, node, coef = np.empty(most, dtype=np.int64), np.empty((most, 2), dtype=np.int64), np.zeros((most, 2, 3, 3))
    stiffness, count, curved = np.empty(most), 0, 0
    weights = np.empty((2, 3, 3))
    for k in range(len(contacts)):
        c = contacts[k] - strands.first
        if c < 0:
            continue
        row[count] = first_row + k
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            node[count, side] = shares(state.fraction[many + 2 * c + side], len(view.nodes) - 1, weights[side])
            for i in range(3):
                for axis in range(3):
                    coef[count, side, i, axis] = sign * weights[side, 0, i] * view.normal[contacts[k], axis]
        count += 1
    for k in range(len(contacts)):
        c = contacts[k] - strands.first
        if c < 0 or not state.push[contacts[k]] > WEAK * rod.force_scale:
            continue
        at, own = many + 2 * c, contacts[k]
        found, values = curvature(
            view.nodes,
            view.nodes,
            state.fraction[at : at + 2],
            strands.cell[c],
            view.normal[own],
            view.gap[own],
            strands.distance[c],
            state.push[own],
            coef[count : count + 4],
            node[count : count + 4],
        )
        for q in range(found):
            row[count], stiffness[curved] = next_row + curved, values[q]
            count, curved = count + 1, curved + 1
    return Spread(row[:count], node[:count], coef[:count]), stiffness[:curved]


@kernel
def curvature(nodes, others, place, cell, n, gap, distance, push, coef, node):  # type: ignore[no-untyped-def]
    """Eigenvectors of minus the force times the second derivative of a gap: rows into `coef` (4, 2, 3, 3), stiffness (4,) [N/m].

    `place` (2,) is where the two axes meet, `nodes` and `others` those of the first and of the second, which may be the same.
    """
    weights, point = np.empty((2, 3, 3)), np.empty((2, 3, 3))
    first = np.empty(2, dtype=np.int64)
    first[0] = point_at(nodes, place[0], weights[0], point[0])
    first[1] = point_at(others, place[1], weights[1], point[1])
    d = gap + distance
    d = np.copysign(max(abs(d), LEAST * distance), d)
    across = _two_across(n)
    form = _second_derivative(point, n, d, across, place, len(others) - 1.0, cell)
    values, vectors = np.linalg.eigh(-push * form)
    found, largest, kept = 0, np.abs(values).max(), np.empty(4)
    for q in range(4):
        if abs(values[q]) <= NEGLIGIBLE * largest:
            continue
        kept[found], node[found] = values[q], first
        for i in range(3):
            for k in range(3):
                v = vectors[0, q] * across[0, k] + vectors[1, q] * across[1, k]
                coef[found, 0, i, k] = v * weights[0, 0, i] + vectors[2, q] * n[k] * weights[0, 1, i]
                coef[found, 1, i, k] = -v * weights[1, 0, i] - vectors[3, q] * n[k] * weights[1, 1, i]
        found += 1
    return found, kept


@kernel
def _second_derivative(point, n, d, across, place, last, cell):  # type: ignore[no-untyped-def]
    """The form (4, 4) of the module's docstring, over u along `across` (2, 3), n.u'(x) and -n.u'(y)."""
    slope = np.zeros((2, 4))  # F
    for side in range(2):
        sign = 1.0 if side == 0 else -1.0
        slope[side, 0], slope[side, 1] = sign * inner(point[side, 1], across[0]) / d, sign * inner(point[side, 1], across[1]) / d
        slope[side, 2 + side] = 1.0
    a = d * (slope[0, 0] ** 2 + slope[0, 1] ** 2) + inner(n, point[0, 2])
    b = d * (slope[1, 0] ** 2 + slope[1, 1] ** 2) - inner(n, point[1, 2])
    ab = d * (slope[0, 0] * slope[1, 0] + slope[0, 1] * slope[1, 1])
    form = np.zeros((4, 4))
    form[0, 0] = form[1, 1] = 1.0 / d
    moves_x, moves_y = cell[0] < place[0] < cell[1] and a * d > 0.0, 0.0 < place[1] < last and b * d > 0.0
    cross = a * b - ab * ab
    if moves_x and moves_y and cross > ALONG * a * b:
        for i in range(4):
            for j in range(4):
                form[i, j] -= (
                    slope[0, i] * b * slope[0, j]
                    + slope[1, i] * a * slope[1, j]
                    - ab * (slope[0, i] * slope[1, j] + slope[1, i] * slope[0, j])
                ) / cross
    elif moves_y:
        for i in range(4):
            for j in range(4):
                form[i, j] -= slope[1, i] * slope[1, j] / b
    elif moves_x and not moves_y:
        for i in range(4):
            for j in range(4):
                form[i, j] -= slope[0, i] * slope[0, j] / a
    return form


@kernel
def _two_across(n):  # type: ignore[no-untyped-def]
    """Two unit vectors (2, 3) square to n and to each other."""
    out, least = np.zeros((2, 3)), 0
    for k in range(1, 3):
        if abs(n[k]) < abs(n[least]):
            least = k
    out[0, least] = 1.0
    for k in range(3):
        out[0, k] -= n[least] * n[k]
    out[0] /= np.sqrt(inner(out[0], out[0]))
    out[1, 0], out[1, 1], out[1, 2] = (
        n[1] * out[0, 2] - n[2] * out[0, 1],
        n[2] * out[0, 0] - n[0] * out[0, 2],
        n[0] * out[0, 1] - n[1] * out[0, 0],
    )
    return out


@kernel
def add_spread(axes, lengths, base, spread, matrix):  # type: ignore[no-untyped-def]
    """Add the columns of spread rows to the border `matrix` (n-1, 3, count): their change with the rotation of every segment."""
    count = len(lengths)
    total = np.empty(3)
    for r in range(len(spread.row)):
        c = spread.row[r]
        for is_ahead in (True, False):
            total[:] = 0.0
            for i in range(count - base if is_ahead else base):
                j = count - 1 - i if is_ahead else i
                node = j + 1 if is_ahead else j  # its vector is handed on through segment j
                for side in range(2):
                    own = node - spread.node[r, side]
                    if 0 <= own < 3:
                        for k in range(3):
                            total[k] += spread.coef[r, side, own, k]
                weight = lengths[j] if is_ahead else -lengths[j]
                matrix[j, 0, c] -= weight * (total[0] * axes[j, 1, 0] + total[1] * axes[j, 1, 1] + total[2] * axes[j, 1, 2])
                matrix[j, 1, c] += weight * (total[0] * axes[j, 0, 0] + total[1] * axes[j, 0, 1] + total[2] * axes[j, 0, 2])
