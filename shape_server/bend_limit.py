"""The least bend radius at the nodes: energy, gradient and Hessian of a law that stiffens beyond it, compiled.

A node whose curvature kappa is beyond the limit k = 1 / radius has the energy cell K (|kappa| - k)^2 / 2 more, K = `HARD` EI, and with it
the moment K (|kappa| - k) about the axis of its bend: a spring towards zero of K (1 - k / |kappa|), which `vertex` knows as a law of its
own, and for the change of |kappa| itself K k / |kappa| more. Derived here, checked by differences in the tests (`effects.bend_radius`).
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel
from .vertices import CLAMP, INNER, relative, strain_scale, vertex


@kernel
def limit_energy(frames, lengths, elastic, clamp_of_node, clamp_frames):  # type: ignore[no-untyped-def]
    """Energy of all nodes beyond the limit [J]; `elastic` is an `Elastic`."""
    total, rho, count = 0.0, np.empty(4), len(lengths)
    for j in range(count):
        for side in range(2):
            if not _has_place(clamp_of_node, j, side):
                continue
            before, after, cell, kind = place(frames, lengths, clamp_of_node, clamp_frames, j, side)
            relative(before, after, rho)
            beyond = strain_scale(rho[3], cell, kind) * np.sqrt(rho[0] ** 2 + rho[1] ** 2) - elastic.limit[0]
            total += 0.5 * cell * elastic.limit[1] * max(beyond, 0.0) ** 2
    return total


@kernel
def add_limit(frames, lengths, elastic, clamp_of_node, clamp_frames, gradient, diagonal, upper):  # type: ignore[no-untyped-def]
    """Add the nodes beyond the limit to gradient, diagonal and upper blocks as `vertices.assemble` gives them."""
    rho, ga, gb, none = np.empty(4), np.empty(3), np.empty(3), np.zeros(3)
    haa, hab, hbb, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3, 3))
    law, first, second = np.zeros(3), np.empty(3), np.empty(3)
    for j in range(len(lengths)):
        for side in range(2):
            if not _has_place(clamp_of_node, j, side):
                continue
            before, after, cell, kind = place(frames, lengths, clamp_of_node, clamp_frames, j, side)
            law[0] = law[1] = secant(before, after, cell, kind, elastic.limit, rho)
            if law[0] == 0.0:
                continue
            vertex(before, after, cell, kind, law, none, rho, ga, gb, haa, hab, hbb, work)
            factor, size = (2.0 + 2.0 * kind) / cell, np.sqrt(rho[0] ** 2 + rho[1] ** 2)
            more = cell * (elastic.limit[1] - law[0])  # K k / |kappa|
            for i in range(3):
                first[i] = -factor * (work[0, i, 0] * rho[0] + work[0, i, 1] * rho[1]) / size
                second[i] = factor * (work[0, 0, i] * rho[0] + work[0, 1, i] * rho[1]) / size
            is_clamp = clamp_of_node[j + side] >= 0
            for r in range(3):
                if not is_clamp or side == 1:
                    own = j if is_clamp else j - 1
                    gradient[own, r] += ga[r]
                    for c in range(3):
                        diagonal[own, r, c] += haa[r, c] + more * first[r] * first[c]
                if not is_clamp or side == 0:
                    gradient[j, r] += gb[r]
                    for c in range(3):
                        diagonal[j, r, c] += hbb[r, c] + more * second[r] * second[c]
                if not is_clamp:
                    for c in range(3):
                        upper[j - 1, r, c] += hab[r, c] + more * first[r] * second[c]


@kernel
def secant(before, after, cell, kind, limit, rho):  # type: ignore[no-untyped-def]
    """Moment over curvature that the limit adds at a node [N m^2]; zero within it. Leaves the relative rotation in `rho`."""
    relative(before, after, rho)
    curvature = strain_scale(rho[3], cell, kind) * np.sqrt(rho[0] ** 2 + rho[1] ** 2)
    return limit[1] * (1.0 - limit[0] / curvature) if curvature > limit[0] else 0.0


@kernel
def place(frames, lengths, clamp_of_node, clamp_frames, j, side):  # type: ignore[no-untyped-def]
    """Frames before and after the node at one end of segment j, length and kind of its cell."""
    clamp = clamp_of_node[j + side]
    if clamp < 0:
        return frames[j - 1], frames[j], 0.5 * (lengths[j - 1] + lengths[j]), INNER
    if side == 0:
        return clamp_frames[clamp], frames[j], 0.5 * lengths[j], CLAMP
    return frames[j], clamp_frames[clamp], 0.5 * lengths[j], CLAMP


@kernel
def _has_place(clamp_of_node, j, side):  # type: ignore[no-untyped-def]
    """Whether a node belongs to segment j here: a clamp to both of its segments, a node between two to the second alone."""
    return clamp_of_node[j + side] >= 0 or (side == 0 and j > 0)
