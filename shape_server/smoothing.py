"""Ties between the curvatures of neighbouring nodes: what a micro-structure length adds to the rod, compiled.

A segment of length h resists a difference of the curvatures e (less the natural ones) at its two ends,

    energy  sum over both axes of bending of  c (e_right - e_left)^2 / 2   [J],       c = l^2 EI / h   [N m^3],

which is l^2 EI e'^2 / 2 per metre with e' the difference quotient at its middle (`effects.micro_length`). At an end without a clamp no
frame says how far the last half segment bends: its curvature e_0 is free, and the least of EI h e_0^2 / 4 + c (e_1 - e_0)^2 / 2 is at
e_0 = e_1 c / (c + EI h / 2). That is a tie of 1 / (1 / c + 2 / EI h) to no curvature at all, and leaves neither moment nor double moment.

Seen from one node its ties are a spring towards the mean curvature of its neighbours, a law and a natural curvature as any other, so that
`vertex` gives every term in which the node occurs alone. Between nodes there remain the products -c (d e_left) (d e_right), with
d e = factor / cell (B theta_after - B^T theta_before); they reach one frame further than bending does, to the blocks `beyond` of frames
j and j + 2. Derived here, checked by differences in the tests.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel
from .vertices import CLAMP, INNER, relative, strain_scale, vertex


@kernel
def tied(frames, lengths, elastic, clamp_of_node, clamp_frames):  # type: ignore[no-untyped-def]
    """Curvature less the natural one at both ends of every segment, (n-1, 2, 2) [1/m], and the ties between them (n-1, 2) [N m^3].

    At an end without a clamp the curvature is zero, and the tie that of the module's docstring.
    """
    count, rho = len(lengths), np.empty(4)
    strain, ties = np.zeros((count, 2, 2)), elastic.smoothing.copy()
    for j in range(count):
        for side in range(2):
            if _is_free(clamp_of_node, j + side):
                for k in range(2):
                    ties[j, k] = 1.0 / (1.0 / ties[j, k] + 2.0 / (elastic.law[j, k] * lengths[j]))
                continue
            before, after, cell, kind, bent = _place(frames, lengths, elastic, clamp_of_node, clamp_frames, j, side)
            relative(before, after, rho)
            scale = strain_scale(rho[3], cell, kind)
            for k in range(2):
                strain[j, side, k] = scale * rho[k] - bent[k]
    return strain, ties


@kernel
def smoothing_energy(frames, lengths, elastic, clamp_of_node, clamp_frames):  # type: ignore[no-untyped-def]
    """Energy of the ties [J]; `elastic` is an `Elastic`."""
    strain, ties = tied(frames, lengths, elastic, clamp_of_node, clamp_frames)
    total = 0.0
    for j in range(len(lengths)):
        for k in range(2):
            total += 0.5 * ties[j, k] * (strain[j, 1, k] - strain[j, 0, k]) ** 2
    return total


@kernel
def add_smoothing(frames, lengths, elastic, clamp_of_node, clamp_frames, gradient, diagonal, upper):  # type: ignore[no-untyped-def]
    """Add the ties to gradient, diagonal and upper blocks as `vertices.assemble` gives them.

    Returns:
        The blocks (n-1, 3, 3) between every segment and the one after the next; the last two are zero.
    """
    strain, ties = tied(frames, lengths, elastic, clamp_of_node, clamp_frames)
    slope = _add_nodes(frames, lengths, elastic, clamp_of_node, clamp_frames, strain, ties, gradient, diagonal, upper)
    beyond = np.zeros_like(upper)
    for j in range(len(lengths)):
        for k in range(2):
            left, right = slope[j, 0, :, k], slope[j, 1, :, k]
            for r in range(3):
                for c in range(3):
                    diagonal[j, r, c] -= ties[j, k] * (left[1, r] * right[0, c] + right[0, r] * left[1, c])
                    upper[j, r, c] -= ties[j, k] * left[1, r] * right[1, c]
                    if j > 0:
                        upper[j - 1, r, c] -= ties[j, k] * left[0, r] * right[0, c]
                        beyond[j - 1, r, c] -= ties[j, k] * left[0, r] * right[1, c]
    return beyond


@kernel
def _add_nodes(frames, lengths, elastic, clamp_of_node, clamp_frames, strain, ties, gradient, diagonal, upper):  # type: ignore[no-untyped-def]
    """Add the terms in which every node occurs alone.

    Returns:
        Change of the curvature at both ends of every segment with the turns of the frames before and after that node,
        (n-1, end, frame, 2, 3) [1/m]; zero for a clamp's frame and at a free end.
    """
    count = len(lengths)
    slope = np.zeros((count, 2, 2, 2, 3))
    law, mean, rho, ga, gb = np.zeros(3), np.zeros(3), np.empty(4), np.empty(3), np.empty(3)
    haa, hab, hbb, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3, 3))
    for j in range(count):
        for side in range(2):
            is_clamp = clamp_of_node[j + side] >= 0
            # A node between two segments is added with the second of them.
            if not is_clamp and (side == 1 or j == 0):
                continue
            before, after, cell, kind, bent = _place(frames, lengths, elastic, clamp_of_node, clamp_frames, j, side)
            for k in range(2):
                law[k], mean[k] = ties[j, k], ties[j, k] * strain[j, 1 - side, k]
                if not is_clamp:
                    law[k] += ties[j - 1, k]
                    mean[k] += ties[j - 1, k] * strain[j - 1, 0, k]
                mean[k] = bent[k] + mean[k] / law[k]
                law[k] /= cell
            vertex(before, after, cell, kind, law, mean, rho, ga, gb, haa, hab, hbb, work)
            if not is_clamp or side == 1:
                first = j - 1 + side
                gradient[first] += ga
                diagonal[first] += haa
            if not is_clamp or side == 0:
                gradient[j] += gb
                diagonal[j] += hbb
            scale = (2.0 + 2.0 * kind) / cell
            for k in range(2):
                for c in range(3):
                    slope[j, side, 0, k, c] = 0.0 if is_clamp and side == 0 else -scale * work[0, c, k]
                    slope[j, side, 1, k, c] = 0.0 if is_clamp and side == 1 else scale * work[0, k, c]
            if not is_clamp:
                upper[j - 1] += hab
                slope[j - 1, 1] = slope[j, 0]
    return slope


@kernel
def _is_free(clamp_of_node, node):  # type: ignore[no-untyped-def]
    return clamp_of_node[node] < 0 and (node == 0 or node == len(clamp_of_node) - 1)


@kernel
def _place(frames, lengths, elastic, clamp_of_node, clamp_frames, j, side):  # type: ignore[no-untyped-def]
    """Frames before and after the node at one end of segment j, length and kind of its cell, natural curvature."""
    node = j + side
    clamp = clamp_of_node[node]
    if clamp < 0:
        return frames[node - 1], frames[node], 0.5 * (lengths[node - 1] + lengths[node]), INNER, elastic.node_bent[node]
    if side == 0:
        return clamp_frames[clamp], frames[j], 0.5 * lengths[j], CLAMP, elastic.bent[j]
    return frames[j], clamp_frames[clamp], 0.5 * lengths[j], CLAMP, elastic.bent[j]
