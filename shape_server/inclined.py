"""Rows of inclination: the derivative of the axis at a bonded place, and the couple that holds it; compiled. See `effects.inclination`."""

from __future__ import annotations

import numpy as np

from .jitted import kernel
from .strand_rows import Spread
from .strands import shares


@kernel
def incline(nodes, held, miss):  # type: ignore[no-untyped-def]
    """Into the last rows of `miss` (h,) [m]: axis . r' less its goal, r' along a segment."""
    weights = np.empty((3, 3))
    for row in range(len(miss) - held.inclined, len(miss)):
        first = shares(held.rows["element"][row] + held.rows["fraction"][row], len(nodes) - 1, weights)
        miss[row] = -held.rows["goal"][row]
        for node in range(3):
            for k in range(3):
                miss[row] += held.rows["axis"][row, k] * weights[1, node] * nodes[first + node, k]


@kernel
def add_couples(forces, held, force, holds):  # type: ignore[no-untyped-def]
    """Add the couples of the rows of inclination whose bonds hold, as forces (n, 3) [N] that add up to nothing."""
    weights = np.empty((3, 3))
    for row in range(len(force) - held.inclined, len(force)):
        if not holds[held.rows["bond"][row]]:
            continue
        first = shares(held.rows["element"][row] + held.rows["fraction"][row], len(forces) - 1, weights)
        for node in range(3):
            for k in range(3):
                forces[first + node, k] += force[row] * weights[1, node] * held.rows["axis"][row, k]


@kernel
def inclined_rows(held, chosen, last):  # type: ignore[no-untyped-def]
    """The `Spread` of those rows of inclination that are among the held rows `chosen` (h,); `last` is the last node."""
    first, found, weights = len(held.rows) - held.inclined, 0, np.empty((3, 3))
    many = len(chosen)
    row, node, coef = np.empty(many, dtype=np.int64), np.zeros((many, 2), dtype=np.int64), np.zeros((many, 2, 3, 3))
    for k in range(many):
        if chosen[k] < first:
            continue
        row[found] = k
        node[found, 0] = shares(held.rows["element"][chosen[k]] + held.rows["fraction"][chosen[k]], last, weights)
        for i in range(3):
            for axis in range(3):
                coef[found, 0, i, axis] = weights[1, i] * held.rows["axis"][chosen[k], axis]
        found += 1
    return Spread(row[:found], node[:found], coef[:found])
