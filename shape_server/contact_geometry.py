"""Distance between the cable's axis and the features it touches, with first and second derivatives.

A row of `Contacts` is a plane (face), an infinite line (edge) or a point (vertex). On a face the material point is fixed.
On an edge or a vertex the nearest point of the straight segment slides along it, and a little beyond its ends; there the
row of the neighbouring segment takes over (`effects.contact` sets rows on neighbours too).

The axis bends at its nodes only, and left at that, an edge would be pinned at them: the energy of the discrete rod under a
sliding force F has a ripple -F kappa/2 (s (h - s) + const) within each segment of length h, as the peak of the moment falls
between the nodes. The distance is therefore measured from the segment less a bulge b(s), a cubic whose slopes at the ends are
half the turn alpha of the axis at that node, towards the feature: b' = (-alpha_0 / 2, alpha_1 / 2), b = alpha h / 8 where the
axis bends around the feature and 0 where it bends away. The turns count as given numbers when the gap is differentiated: a
change of theirs moves it by h/8 of the change, which the next iteration takes up. The bulge cancels the ripple, the force
turns smoothly from segment
to segment, and the axis stays clear by at most kappa h^2 / 8 of what it touches, never too near. A row that `is_straight` has no
bulge (`system`).

First derivative, with c the nearest point, t the tangent, n the normal and e the edge, m = e x n, mu = m.t (for a vertex
m = t, mu = 1, and a further row across), a = m.dc, b_ = n.dt, d the distance: the point slides by -(a + d b_ / mu) / mu, so

    d gap = n.dc + b' (a + d b_ / mu) / mu

and the second derivative beyond what a fixed force gives is -2 a b_ / mu - d b_^2 / mu^2 - b'' (a + d b_ / mu)^2 / mu^2, or
a^2 / d where the point cannot slide. It follows from minimising the distance over the sliding; derived here, checked by
differences in the tests. Without it, Newton's method diverges on a sharp lip, where force over distance (0.5 N / 4.5 mm) is
ten times the stiffness of the cable. Multiplied by minus the force, it enters as rows with an indefinite compliance.
"""

from __future__ import annotations

import math

import numpy as np

from .chain_terms import cross, dot, moved, scaled, three
from .jitted import kernel

FACE, EDGE, VERTEX = 0, 1, 2
PARALLEL = 0.02  # sine of the angle below which a segment counts as parallel to an edge
BEYOND = 0.1  # of a segment, how far past its ends a row still holds
SQUARE = 1e-3  # cosine between slide and tangent below which a contact does not slide
FAR = 1.0  # m, gap of a row that another one has taken over from, on the next segment or edge


@kernel
def contact_geometry(nodes, axes, lengths, touch, fraction):  # type: ignore[no-untyped-def]
    """Where each contact is now. `fraction` is updated in place for edges and vertices.

    Args:
        nodes: (n, 3) [m].
        axes: (n-1, 3, 3) directors of the segments.
        lengths: (n-1,) [m].
        touch: (m,) of `rod.TOUCH`; of the normal when the contact was found it matters on which side the cable is.
        fraction: (m,) place along the segment, 0 to 1, or a little beyond.

    Returns:
        gap (m,) [m], negative where the cable would have to be pushed; normal n (m, 3); push (m, 3), the direction of the
        force, n + b'/mu m; slide m (m, 3); across (m, 3), zero unless a vertex; and numbers (m, 4): mu (0 where the contact
        does not slide), d [m], the couple b' d / mu^2 [m], and b'' [1/m].
    """
    element, feature, point, given = touch["element"], touch["feature"], touch["point"], touch["normal"]
    direction, extent, distance, is_straight = touch["direction"], touch["extent"], touch["distance"], touch["is_straight"]
    many, count = element.shape[0], lengths.shape[0]
    gap, numbers = np.empty(many), np.zeros((many, 4))
    normal, push, slide, across = np.empty((many, 3)), np.empty((many, 3)), np.zeros((many, 3)), np.zeros((many, 3))
    for c in range(many):
        j, kind, at, side, h = element[c], feature[c], three(point, c), three(given, c), lengths[element[c]]
        tangent, edge, extents = _tangent(axes, j), three(direction, c), (extent[c, 0], extent[c, 1])
        segment = three(nodes, j), three(nodes, j + 1), tangent, h, j == 0, j == count - 1
        if kind == FACE:
            gap[c] = dot(_away(segment[0], tangent, h * fraction[c], at), side) - distance[c]
            numbers[c, 1] = distance[c]
            for k in range(3):
                normal[c, k] = push[c, k] = side[k]
            continue
        share, is_free, offset, kind = _nearest(segment, at, edge, kind, extents)
        size = math.sqrt(dot(offset, offset))
        # A contact may turn by more than a right angle around a sharp edge before it is on the other side of it.
        signed = size if dot(offset, side) >= -0.5 * size else -size
        away = scaled(1.0 / signed, offset) if size > 1e-12 else side
        fraction[c], gap[c], numbers[c, 1] = share, signed - distance[c], max(signed, 1e-3 * distance[c])
        for k in range(3):
            normal[c, k] = push[c, k] = away[k]
        if share < -BEYOND or share > 1.0 + BEYOND:
            fraction[c] = min(max(share, -BEYOND), 1.0 + BEYOND)
            gap[c] = FAR
            continue
        way, beside = _directions(tangent, away, edge, kind, is_free)
        for k in range(3):
            slide[c, k], across[c, k] = way[k], beside[k]
        mu = dot(way, tangent)
        # In one plane with an edge that it crosses, a cable is square to the way in which it could slide.
        if is_free and abs(mu) > SQUARE:
            first, last = (0.0, 0.0) if is_straight[c] == 1 else (_turn(axes, j, away), _turn(axes, j + 1, away))
            bulge, slope, bend = _bulge(share, h, first, last)
            gap[c] -= bulge
            numbers[c, 0], numbers[c, 2], numbers[c, 3] = mu, slope * numbers[c, 1] / (mu * mu), bend
            for k in range(3):
                push[c, k] += slope / mu * way[k]
    return gap, normal, push, slide, across, numbers


@kernel
def _tangent(axes, j):  # type: ignore[no-untyped-def]
    return axes[j, 2, 0], axes[j, 2, 1], axes[j, 2, 2]


@kernel
def _away(start, tangent, place, point):  # type: ignore[no-untyped-def]
    """Vector (3) [m] from a point to a place on a segment [m from its first node]."""
    return moved(moved(start, place, tangent), -1.0, point)


@kernel
def _nearest(segment, point, edge, feature, extent):  # type: ignore[no-untyped-def]
    """Share of a segment at which it is nearest to a feature, whether the contact can slide there, vector (3) [m] to it, and the feature.

    Past its end an edge is the point where it ends, so that the next edge takes over without a jump.
    """
    share, is_free = _place(segment, point, edge, feature)
    offset = _away(segment[0], segment[2], segment[3] * share, point)
    if feature == VERTEX:
        return share, is_free, offset, feature
    along = dot(offset, edge)
    stop = min(max(along, extent[0]), extent[1])
    if stop == along:
        return share, is_free, moved(offset, -along, edge), feature
    point = moved(point, stop, edge)
    share, is_free = _place(segment, point, edge, VERTEX)
    return share, is_free, _away(segment[0], segment[2], segment[3] * share, point), VERTEX


@kernel
def _place(segment, point, edge, feature):  # type: ignore[no-untyped-def]
    """Share of a segment at which it is nearest to a feature, and whether the contact can slide there.

    A segment is its first and last node, its tangent and length, and whether it is the first or the last one of its cable.
    """
    start, end, tangent, h, is_first, is_last = segment
    away, is_free = moved(start, -1.0, point), True
    share, along = -dot(away, tangent) / h, dot(away, edge)
    if feature != VERTEX:
        cosine = dot(tangent, edge)
        sine2 = 1.0 - cosine * cosine
        is_free = sine2 > PARALLEL * PARALLEL
        if is_free:
            share = (cosine * along - dot(away, tangent)) / sine2 / h
        else:
            # Beside a parallel edge every point is nearest; the rows of the segments hold one node each.
            other = moved(end, -1.0, point)
            share = 0.0 if dot(away, away) - along**2 <= dot(other, other) - dot(other, edge) ** 2 else 1.0
    if (is_first and share < 0.0) or (is_last and share > 1.0):
        return min(max(share, 0.0), 1.0), False
    return share, is_free


@kernel
def _directions(t, n, e, feature, is_free):  # type: ignore[no-untyped-def]
    """Directions (3), (3) in which the distance is curved: along the cable, and across for a vertex, else zero."""
    if feature == EDGE:
        return cross(e, n), (0.0, 0.0, 0.0)
    across = cross(t, n)
    if is_free:
        return t, across
    scale = 1.0 / max(math.sqrt(dot(across, across)), 1e-12)
    across = scaled(scale, across)
    return cross(n, across), across


@kernel
def _turn(axes, node, n):  # type: ignore[no-untyped-def]
    """Turn of the axis at a node towards the feature, in radians."""
    if node <= 0 or node >= axes.shape[0]:
        return 0.0
    return dot(n, _tangent(axes, node - 1)) - dot(n, _tangent(axes, node))


@kernel
def _bulge(x, h, first, last):  # type: ignore[no-untyped-def]
    """Bulge, slope and second derivative at share x of a segment of length h, from the turns at its ends."""
    b0, b1 = 0.125 * h * max(first, 0.0), 0.125 * h * max(last, 0.0)
    s0, s1 = -0.5 * first * h, 0.5 * last * h
    c2, c3 = 3 * (b1 - b0) - 2 * s0 - s1, 2 * (b0 - b1) + s0 + s1
    value = b0 + x * (s0 + x * (c2 + x * c3))
    return value, (s0 + x * (2 * c2 + 3 * c3 * x)) / h, (2 * c2 + 6 * c3 * x) / (h * h)
