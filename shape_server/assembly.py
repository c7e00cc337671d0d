"""Gradient and Hessian of a whole rod: bending and twist at its nodes, and the work of the forces that its segments hand on; compiled."""

from __future__ import annotations

import numpy as np

from .chain_terms import three, vertex_terms
from .jitted import inlined, kernel
from .vertices import CLAMP, INNER

NONE = -1  # in place of a segment: a clamp


@kernel
def assemble(frames, axes, lengths, pulled, elastic, clamp_of_node, clamp_frames, carried):  # type: ignore[no-untyped-def]
    """Gradient (n-1, 3), diagonal (n-1, 3, 3) and upper blocks (n-1, 3, 3) of energy less the work of the forces.

    Args:
        frames: (n-1, 4).
        axes: (n-1, 3, 3) directors.
        lengths: (n-1,) [m] unstretched.
        pulled: (n-1,) [m] as they are.
        elastic: An `Elastic`.
        clamp_of_node: (n,) index of the clamp at each node, -1 for none.
        clamp_frames: (c, 4).
        carried: (n-1, 3) [N] force that each segment hands on.
    """
    count = len(lengths)
    gradient, diagonal, upper = np.empty((count, 3)), np.empty((count, 3, 3)), np.zeros((count, 3, 3))
    _hand_on(axes, pulled, carried, gradient, diagonal)
    law, bent, node_law, node_bent = elastic.law, elastic.bent, elastic.node_law, elastic.node_bent
    for node in range(count + 1):
        clamp = clamp_of_node[node]
        # A clamp is a vertex on each of its sides; the formulas stand in the loop once, for they are compiled wherever they stand.
        for side in range(1 if clamp < 0 else 2):
            before, after, kind = node - 1, node, INNER
            if clamp < 0:
                if node == 0 or node == count:
                    continue
                cell, stiff, curve = 0.5 * (lengths[node - 1] + lengths[node]), three(node_law, node), three(node_bent, node)
            else:
                k, kind = node - 1 + side, CLAMP
                before, after = (k, NONE) if side == 0 else (NONE, k)
                if k < 0 or k == count:
                    continue
                cell, stiff, curve = 0.5 * lengths[k], three(law, k), three(bent, k)
            q_before = _frame(frames, before) if before >= 0 else _frame(clamp_frames, clamp)
            q_after = _frame(frames, after) if after >= 0 else _frame(clamp_frames, clamp)
            slopes, first, second, couple = vertex_terms(q_before, q_after, cell, stiff, curve, kind)
            if before >= 0:
                _add(gradient, diagonal, before, slopes[0], first[0], first[1])
            if after >= 0:
                _add(gradient, diagonal, after, slopes[1], second[0], second[1])
            if kind == INNER:
                upper[before, 0, 0], upper[before, 0, 1], upper[before, 0, 2] = couple[0]
                upper[before, 1, 0], upper[before, 1, 1], upper[before, 1, 2] = couple[1]
                upper[before, 2, 0], upper[before, 2, 1], upper[before, 2, 2] = couple[2]
    return gradient, diagonal, upper


@kernel
def _hand_on(axes, pulled, carried, gradient, diagonal):  # type: ignore[no-untyped-def]
    """Set gradient and diagonal blocks to those of the work of the forces that segments hand on."""
    for j in range(len(pulled)):
        h = pulled[j]
        n0 = axes[j, 0, 0] * carried[j, 0] + axes[j, 0, 1] * carried[j, 1] + axes[j, 0, 2] * carried[j, 2]
        n1 = axes[j, 1, 0] * carried[j, 0] + axes[j, 1, 1] * carried[j, 1] + axes[j, 1, 2] * carried[j, 2]
        n2 = axes[j, 2, 0] * carried[j, 0] + axes[j, 2, 1] * carried[j, 1] + axes[j, 2, 2] * carried[j, 2]
        gradient[j, 0], gradient[j, 1], gradient[j, 2] = h * n1, -h * n0, 0.0
        diagonal[j, 0, 0] = diagonal[j, 1, 1] = h * n2
        diagonal[j, 0, 1] = diagonal[j, 1, 0] = diagonal[j, 2, 2] = 0.0
        diagonal[j, 0, 2] = diagonal[j, 2, 0] = -0.5 * h * n0
        diagonal[j, 1, 2] = diagonal[j, 2, 1] = -0.5 * h * n1


@inlined
def _frame(frames, j):  # type: ignore[no-untyped-def]
    return frames[j, 0], frames[j, 1], frames[j, 2], frames[j, 3]


@inlined
def _add(gradient, diagonal, j, slope, x, y):  # type: ignore[no-untyped-def]
    """Add to a segment the slope and the halves (xx, xy, xz), (yy, yz, zz) of a block."""
    gradient[j, 0] += slope[0]
    gradient[j, 1] += slope[1]
    gradient[j, 2] += slope[2]
    diagonal[j, 0, 0] += x[0]
    diagonal[j, 1, 1] += y[0]
    diagonal[j, 2, 2] += y[2]
    diagonal[j, 0, 1] += x[1]
    diagonal[j, 1, 0] += x[1]
    diagonal[j, 0, 2] += x[2]
    diagonal[j, 2, 0] += x[2]
    diagonal[j, 1, 2] += y[1]
    diagonal[j, 2, 1] += y[1]
