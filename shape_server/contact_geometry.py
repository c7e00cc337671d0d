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

import numpy as np

from .jitted import kernel

FACE, EDGE, VERTEX = 0, 1, 2
PARALLEL = 0.02  # sine of the angle below which a segment counts as parallel to an edge
BEYOND = 0.1  # of a segment, how far past its ends a row still holds
SQUARE = 1e-3  # cosine between slide and tangent below which a contact does not slide
FAR = 1.0  # m, gap of a row that another one has taken over from, on the next segment or edge


@kernel
def _along(a, t, point, e, feature):  # type: ignore[no-untyped-def]
    """Place of the nearest point on the segment's line [m from its first node], and whether it can slide."""
    w0, w1, w2 = a[0] - point[0], a[1] - point[1], a[2] - point[2]
    wt = w0 * t[0] + w1 * t[1] + w2 * t[2]
    if feature == VERTEX:
        return -wt, True
    we = w0 * e[0] + w1 * e[1] + w2 * e[2]
    te = t[0] * e[0] + t[1] * e[1] + t[2] * e[2]
    sine2 = 1.0 - te * te
    if sine2 > PARALLEL * PARALLEL:
        return (te * we - wt) / sine2, True
    return 0.0, False


@kernel
def _nearer_end(nodes, j, point, e):  # type: ignore[no-untyped-def]
    """0 or 1: the end of a segment that is nearer to a line."""
    sizes = np.zeros(2)
    for end in range(2):
        w0, w1, w2 = nodes[j + end, 0] - point[0], nodes[j + end, 1] - point[1], nodes[j + end, 2] - point[2]
        we = w0 * e[0] + w1 * e[1] + w2 * e[2]
        sizes[end] = w0 * w0 + w1 * w1 + w2 * w2 - we * we
    return 0.0 if sizes[0] <= sizes[1] else 1.0


@kernel
def _turn(axes, node, n):  # type: ignore[no-untyped-def]
    """Turn of the axis at a node towards the feature, in radians."""
    if node <= 0 or node >= axes.shape[0]:
        return 0.0
    before, after = axes[node - 1, 2], axes[node, 2]
    return -(n[0] * (after[0] - before[0]) + n[1] * (after[1] - before[1]) + n[2] * (after[2] - before[2]))


@kernel
def _bulge(x, h, first, last):  # type: ignore[no-untyped-def]
    """Bulge, slope and second derivative at share x of a segment of length h, from the turns at its ends."""
    b0, b1 = 0.125 * h * max(first, 0.0), 0.125 * h * max(last, 0.0)
    s0, s1 = -0.5 * first * h, 0.5 * last * h
    c2, c3 = 3 * (b1 - b0) - 2 * s0 - s1, 2 * (b0 - b1) + s0 + s1
    value = b0 + x * (s0 + x * (c2 + x * c3))
    return value, (s0 + x * (2 * c2 + 3 * c3 * x)) / h, (2 * c2 + 6 * c3 * x) / (h * h)


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
    many = element.shape[0]
    gap, numbers = np.empty(many), np.zeros((many, 4))
    normal, push, slide, across = np.empty((many, 3)), np.empty((many, 3)), np.zeros((many, 3)), np.zeros((many, 3))
    offset = np.empty(3)
    for c in range(many):
        j, is_free, kind, at = element[c], False, feature[c], point[c]
        if kind != FACE:
            fraction[c], is_free = _place(nodes, axes, lengths, j, at, direction[c], kind)
        _away(nodes, axes, lengths, j, fraction[c], at, offset)
        if kind == EDGE:
            along = _dot(offset, direction[c])
            end = min(max(along, extent[c, 0]), extent[c, 1])
            if end == along:
                offset -= along * direction[c]
            else:  # past its end an edge is the point where it ends, so that the next edge takes over without a jump
                kind, at = VERTEX, point[c] + end * direction[c]
                fraction[c], is_free = _place(nodes, axes, lengths, j, at, direction[c], kind)
                _away(nodes, axes, lengths, j, fraction[c], at, offset)
        if kind == FACE:
            gap[c] = _dot(offset, given[c]) - distance[c]
            normal[c], push[c], numbers[c, 1] = given[c], given[c], distance[c]
            continue
        size = np.sqrt(_dot(offset, offset))
        # A contact may turn by more than a right angle around a sharp edge before it is on the other side of it.
        signed = size if _dot(offset, given[c]) >= -0.5 * size else -size
        for k in range(3):
            normal[c, k] = offset[k] / signed if size > 1e-12 else given[c, k]
        push[c] = normal[c]
        gap[c] = signed - distance[c]
        numbers[c, 1] = max(signed, 1e-3 * distance[c])
        if fraction[c] < -BEYOND or fraction[c] > 1.0 + BEYOND:
            fraction[c] = min(max(fraction[c], -BEYOND), 1.0 + BEYOND)
            gap[c] = FAR
            continue
        _directions(axes[j, 2], normal[c], direction[c], kind, is_free, slide[c], across[c])
        # In one plane with an edge that it crosses, a cable is square to the way in which it could slide.
        if is_free and abs(_dot(slide[c], axes[j, 2])) > SQUARE:
            turns = (0.0, 0.0) if is_straight[c] == 1 else (_turn(axes, j, normal[c]), _turn(axes, j + 1, normal[c]))
            gap[c] -= _let_slide(axes[j, 2], lengths[j], turns, fraction[c], slide[c], push[c], numbers[c])
    return gap, normal, push, slide, across, numbers


@kernel
def _away(nodes, axes, lengths, j, share, point, out):  # type: ignore[no-untyped-def]
    """Vector (3,) [m] from a point to the place on the axis at a share of segment j."""
    for k in range(3):
        out[k] = nodes[j, k] + share * lengths[j] * axes[j, 2, k] - point[k]


@kernel
def _place(nodes, axes, lengths, j, point, e, feature):  # type: ignore[no-untyped-def]
    """Share of segment j at which it is nearest, and whether the contact can slide there."""
    place, is_free = _along(nodes[j], axes[j, 2], point, e, feature)
    # Beside a parallel edge every point is nearest; the rows of the segments hold one node each.
    share = place / lengths[j] if is_free else _nearer_end(nodes, j, point, e)
    if (j == 0 and share < 0.0) or (j == lengths.shape[0] - 1 and share > 1.0):
        return min(max(share, 0.0), 1.0), False
    return share, is_free


@kernel
def _directions(t, n, e, feature, is_free, slide, across):  # type: ignore[no-untyped-def]
    """Directions in which the distance is curved: `slide` along the cable, and `across` for a vertex."""
    if feature == EDGE:
        _cross(e, n, slide)
        return
    _cross(t, n, across)
    if is_free:
        slide[:] = t
        return
    scale = 1.0 / max(np.sqrt(_dot(across, across)), 1e-12)
    for k in range(3):
        across[k] *= scale
    _cross(n, across, slide)


@kernel
def _let_slide(tangent, h, turns, share, slide, push, numbers):  # type: ignore[no-untyped-def]
    """Bulge [m] under a contact that can slide, by the turns at its segment's ends; adds its slope to `push`, and fills in `numbers`."""
    mu, d = _dot(slide, tangent), numbers[1]
    value, slope, bend = _bulge(share, h, turns[0], turns[1])
    for k in range(3):
        push[k] += slope / mu * slide[k]
    numbers[0], numbers[2], numbers[3] = mu, slope * d / (mu * mu), bend
    return value


@kernel
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _cross(a, b, out):  # type: ignore[no-untyped-def]
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
