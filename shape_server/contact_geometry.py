"""Distance between the cable's axis and the features it touches, with first and second derivatives.

A row of `Contacts` is a plane (face), an infinite line (edge) or a point (vertex). On a face the material point is fixed.
On an edge or a vertex the nearest point of the straight segment slides along it, and hops to the neighbouring segment
where that one is nearer, so a contact moves continuously along the cable within one solve.

First derivative: the change of n.c with c fixed in its segment (envelope theorem). Second derivative of the distance d
beyond what a fixed force n gives, with a = m.dc, b = n.dt, t the tangent, m = e x n, mu = m.t for an edge (for a vertex
m = t, mu = 1, and a further column across):

    clamped at a node:   a^2 / d
    sliding:            -2 a b / mu - d b^2 / mu^2

It follows from minimising the distance over the sliding; derived here, checked by differences in the tests. Without it,
Newton's method diverges on a sharp lip, where the force over the distance (0.5 N / 4.5 mm) is ten times the stiffness of
the cable. Multiplied by minus the force, it enters the system as border columns with an indefinite compliance.
"""

from __future__ import annotations

import numpy as np
from numba import njit

FACE, EDGE, VERTEX = 0, 1, 2
PARALLEL = 0.05  # sine of the angle below which a segment counts as parallel to an edge


@njit(cache=True)
def _nearest(a, t, length, point, e, feature):  # type: ignore[no-untyped-def]
    """Fraction along the segment that is nearest to the line or point, and whether it was clamped to an end."""
    w0, w1, w2 = a[0] - point[0], a[1] - point[1], a[2] - point[2]
    wt = w0 * t[0] + w1 * t[1] + w2 * t[2]
    if feature == EDGE:
        we = w0 * e[0] + w1 * e[1] + w2 * e[2]
        te = t[0] * e[0] + t[1] * e[1] + t[2] * e[2]
        sine2 = 1.0 - te * te
        along = (te * we - wt) / sine2 if sine2 > PARALLEL * PARALLEL else 0.5 * length
        free = sine2 > PARALLEL * PARALLEL
    else:
        along = -wt
        free = True
    fraction = along / length
    if fraction <= 0.0:
        return 0.0, True
    if fraction >= 1.0:
        return 1.0, True
    return fraction, not free


@njit(cache=True)
def _offset(a, t, along, point, e, feature, out):  # type: ignore[no-untyped-def]
    """Vector from the nearest point of the feature to the axis; returns its length."""
    for k in range(3):
        out[k] = a[k] + along * t[k] - point[k]
    if feature == EDGE:
        we = out[0] * e[0] + out[1] * e[1] + out[2] * e[2]
        for k in range(3):
            out[k] -= we * e[k]
    return np.sqrt(out[0] ** 2 + out[1] ** 2 + out[2] ** 2)


@njit(cache=True)
def contact_geometry(nodes, axes, lengths, element, fraction, feature, point, given, direction, distance):  # type: ignore[no-untyped-def]
    """Where each contact is now. `element` and `fraction` are updated in place for edges and vertices.

    Args:
        nodes: (n, 3) [m].
        axes: (n-1, 3, 3) directors of the segments.
        lengths: (n-1,) [m].
        element: (m,) segment of each contact.
        fraction: (m,) place along it, 0 to 1.
        feature: (m,) face, edge or vertex.
        point: (m, 3) [m] on the feature.
        given: (m, 3) unit normal when the contact was found; says on which side the cable is.
        direction: (m, 3) unit, along the edge.
        distance: (m,) [m] between axis and feature when they touch.

    Returns:
        gap (m,) [m], negative where the cable would have to be pushed; normal (m, 3); slide (m, 3) the vector m above;
        across (m, 3), zero unless a vertex; mu (m,), zero where the contact does not slide; reach (m,) [m] the distance d.
    """
    many = element.shape[0]
    gap, mu, reach = np.empty(many), np.zeros(many), np.empty(many)
    normal, slide, across = np.empty((many, 3)), np.zeros((many, 3)), np.zeros((many, 3))
    offset = np.empty(3)
    for c in range(many):
        j = element[c]
        if feature[c] == FACE:
            gap[c] = -distance[c]
            for k in range(3):
                normal[c, k] = given[c, k]
                gap[c] += given[c, k] * (nodes[j, k] + fraction[c] * lengths[j] * axes[j, 2, k] - point[c, k])
            reach[c] = distance[c]
            continue
        e = direction[c]
        place, clamped = _nearest(nodes[j], axes[j, 2], lengths[j], point[c], e, feature[c])
        size = _offset(nodes[j], axes[j, 2], place * lengths[j], point[c], e, feature[c], offset)
        for _ in range(8):
            other = j - 1 if place == 0.0 else (j + 1 if place == 1.0 else -1)
            if other < 0 or other >= lengths.shape[0]:
                break
            place2, clamped2 = _nearest(nodes[other], axes[other, 2], lengths[other], point[c], e, feature[c])
            size2 = _offset(nodes[other], axes[other, 2], place2 * lengths[other], point[c], e, feature[c], offset)
            if size2 >= size * (1.0 - 1e-12):
                break
            j, place, clamped, size = other, place2, clamped2, size2
        element[c], fraction[c] = j, place
        size = _offset(nodes[j], axes[j, 2], place * lengths[j], point[c], e, feature[c], offset)
        side = offset[0] * given[c, 0] + offset[1] * given[c, 1] + offset[2] * given[c, 2]
        signed = size if side >= 0.0 else -size
        for k in range(3):
            normal[c, k] = offset[k] / signed if size > 1e-12 else given[c, k]
        gap[c] = signed - distance[c]
        reach[c] = max(signed, 1e-3 * distance[c])
        n, t = normal[c], axes[j, 2]
        if feature[c] == EDGE:
            slide[c, 0], slide[c, 1], slide[c, 2] = e[1] * n[2] - e[2] * n[1], e[2] * n[0] - e[0] * n[2], e[0] * n[1] - e[1] * n[0]
            if not clamped:
                mu[c] = slide[c, 0] * t[0] + slide[c, 1] * t[1] + slide[c, 2] * t[2]
        else:
            across[c, 0], across[c, 1], across[c, 2] = t[1] * n[2] - t[2] * n[1], t[2] * n[0] - t[0] * n[2], t[0] * n[1] - t[1] * n[0]
            if clamped:
                a = across[c]
                scale = 1.0 / max(np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2), 1e-12)
                for k in range(3):
                    across[c, k] *= scale
                a = across[c]
                slide[c, 0], slide[c, 1], slide[c, 2] = n[1] * a[2] - n[2] * a[1], n[2] * a[0] - n[0] * a[2], n[0] * a[1] - n[1] * a[0]
            else:
                for k in range(3):
                    slide[c, k] = t[k]
                mu[c] = 1.0
    return gap, normal, slide, across, mu, reach
