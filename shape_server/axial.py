"""Axial compliance of the segments, compiled: what stretch adds to positions, Hessian, columns and compliance.

A segment of rest length h under the force n that it carries is pulled to h (1 + e), e = n.d3 / EA. With e eliminated, the
energy less the work of the forces has the term -h (n.d3 + (n.d3)^2 / 2EA) per segment in place of -h n.d3, and so

    gradient: with h (1 + e) in place of h;      Hessian: -h/EA a a^T more, a = d(n.d3)/dtheta = (-n.d2, n.d1, 0);
    column of a row with direction v: h/EA (v.d3) a more;   compliance of two rows: sum_j h/EA (v.d3) (w.d3).

Linear in the force (Hooke), the area of the section unchanged. Derived here, checked by differences in the tests.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel


@kernel
def pulled_lengths(lengths, give, axes, carried):  # type: ignore[no-untyped-def]
    """Lengths (n-1,) [m] under the forces carried; `give` (n-1,) [m/N] is h / EA."""
    out = np.empty(len(lengths))
    for j in range(len(lengths)):
        along = axes[j, 2, 0] * carried[j, 0] + axes[j, 2, 1] * carried[j, 1] + axes[j, 2, 2] * carried[j, 2]
        out[j] = lengths[j] + give[j] * along
    return out


@kernel
def add_give(give, axes, carried, diagonal, base, element, fraction, vector, is_turn, matrix, compliance):  # type: ignore[no-untyped-def]
    """Add the terms of the Hessian to `diagonal`, of the columns to `matrix` (n-1, 3, c), of the rows to `compliance`."""
    count, many = len(give), len(element)
    reach = np.zeros((count, many))  # share of each segment that a row hangs on, times v.d3
    slope = np.empty((count, 2))
    for j in range(count):
        slope[j, 0] = -(axes[j, 1, 0] * carried[j, 0] + axes[j, 1, 1] * carried[j, 1] + axes[j, 1, 2] * carried[j, 2])
        slope[j, 1] = axes[j, 0, 0] * carried[j, 0] + axes[j, 0, 1] * carried[j, 1] + axes[j, 0, 2] * carried[j, 2]
        for r in range(2):
            for c in range(2):
                diagonal[j, r, c] -= give[j] * slope[j, r] * slope[j, c]
    for c in range(many):
        if is_turn[c]:
            continue
        e, ahead = element[c], element[c] >= base
        for j in range(base, e + 1) if ahead else range(e, base):
            share = 1.0 if ahead else -1.0
            if j == e:
                share *= fraction[c] if ahead else 1.0 - fraction[c]
            reach[j, c] = share * (vector[c, 0] * axes[j, 2, 0] + vector[c, 1] * axes[j, 2, 1] + vector[c, 2] * axes[j, 2, 2])
            for r in range(2):
                matrix[j, r, c] += give[j] * reach[j, c] * slope[j, r]
    for j in range(count):
        for c in range(many):
            if reach[j, c] != 0.0:
                for d in range(many):
                    compliance[c, d] += give[j] * reach[j, c] * reach[j, d]
