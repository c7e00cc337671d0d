"""Where a cable meets itself: the distance between two places of its axis, with first and second derivative, compiled.

A polygon is no good for two strands that slide on each other: it has corners, and an energy with a ripple (see `contact_geometry`). The
axis is therefore taken as the quadratic B-spline whose control points are the nodes, with half a segment at both ends left straight. It
touches every segment at its middle, has a tangent without jumps, and a force on it is shared by three nodes with a second moment of h^2 / 4
wherever it acts, so that there is no ripple. It runs inside the nodes by kappa h^2 / 8, an error of second order like that of the nodes.

A place x counts segments from the start of the cable, r(x) = sum_k W_k(x) r_k. With D = r(x) - r(y), d = |D|, n = D / d:

    gap = d - distance,    d gap = n . u,    u = sum_k W_k(x) dr_k - sum_k W_k(y) dr_k,

where y slides to the nearest place, and x does so within the cell of its node, from half a segment before it to half a segment after. The
next cell has a row of its own. Strands that lie side by side have no one nearest pair, and strands that turn from one crossing to another
have two; a place free to slide would jump between them, and the energy with it, but the least distance of a cell does not. With z the
places that slide (x does not at the end of its cell), the second derivative beyond what fixed forces give is

    |P u|^2 / d - F^T H^-1 F,   P = 1 - n n^T,   F = [r'(x).P u / d + n.u'(x), -r'(y).P u / d - n.u'(y)],
    H = [[|P r'(x)|^2 / d + n.r''(x), -r'(x).P r'(y) / d], [., |P r'(y)|^2 / d - n.r''(y)]],

a quadratic form in four numbers: u along two directions across n, n.u'(x), -n.u'(y). Times minus the force, its eigenvectors are rows whose
compliance is one over their eigenvalue (see `newton`). Derived here, checked by differences in the tests.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .contact_geometry import FAR
from .jitted import kernel

STEPS = 60
NEAREST = 1e-10  # segments; places are found to within this
BEND = 0.5 * np.pi  # of the distance between touching axes: an axis bent no tighter than its tube is thick comes no nearer (Schur 1921)
STRIDE = 0.5  # segments, most that a place moves at once
FLAT = 1e-3  # of the stiffness of the distance against sliding, the least that counts


class Strands(NamedTuple):
    """Places where a cable may touch itself; their rows come after those of the contacts with bodies."""

    first: int  # row of the first
    cell: np.ndarray  # (k, 2) how far the first place slides; the second slides along the whole cable
    distance: np.ndarray  # (k,) m, between the axes when they touch
    s: np.ndarray  # (n,) m, arc length of the nodes


@kernel
def shares(place, last, weights):  # type: ignore[no-untyped-def]
    """First of the three nodes that make a place, their weights and two derivatives into `weights` (3, 3); `last` is the last node."""
    weights[:] = 0.0
    if place < 0.5 or place >= last - 0.5:
        at_end = place >= last - 0.5
        first, skip = (last - 2, 1) if at_end else (0, 0)
        part = place - (last - 1) if at_end else place
        weights[0, skip], weights[0, skip + 1] = 1.0 - part, part
        weights[1, skip], weights[1, skip + 1] = -1.0, 1.0
        return first
    node = int(np.floor(place + 0.5))
    t = place - node
    weights[0, 0], weights[0, 1], weights[0, 2] = 0.5 * (0.5 - t) ** 2, 0.75 - t * t, 0.5 * (0.5 + t) ** 2
    weights[1, 0], weights[1, 1], weights[1, 2] = t - 0.5, -2.0 * t, t + 0.5
    weights[2, 0], weights[2, 1], weights[2, 2] = 1.0, -2.0, 1.0
    return node - 1


@kernel
def point_at(nodes, place, weights, out):  # type: ignore[no-untyped-def]
    """Point, derivative and second derivative of the axis at a place, rows of `out` (3, 3) [m]; the first of its nodes."""
    first = shares(place, len(nodes) - 1, weights)
    for order in range(3):
        for k in range(3):
            out[order, k] = (
                weights[order, 0] * nodes[first, k] + weights[order, 1] * nodes[first + 1, k] + weights[order, 2] * nodes[first + 2, k]
            )
    return first


@kernel
def inner(a, b):  # type: ignore[no-untyped-def]
    """Scalar product of two vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def slide(nodes, others, x, y, cell, weights, one, other):  # type: ignore[no-untyped-def]
    """The places nearest to each other around x of one axis, within its cell, and y of the other, which may be the same.

    `one` and `other` (3, 3) are left as `point_at` there.
    """
    last = len(others) - 1.0
    for _ in range(STEPS):
        point_at(nodes, x, weights, one)
        point_at(others, y, weights, other)
        d0, d1, d2 = one[0, 0] - other[0, 0], one[0, 1] - other[0, 1], one[0, 2] - other[0, 2]
        gx = d0 * one[1, 0] + d1 * one[1, 1] + d2 * one[1, 2]
        gy = -(d0 * other[1, 0] + d1 * other[1, 1] + d2 * other[1, 2])
        tx, ty = inner(one[1], one[1]), inner(other[1], other[1])
        xx = tx + d0 * one[2, 0] + d1 * one[2, 1] + d2 * one[2, 2]
        yy = ty - (d0 * other[2, 0] + d1 * other[2, 1] + d2 * other[2, 2])
        xy = -inner(one[1], other[1])
        stays_x, stays_y = _is_kept(x, gx, cell[0], cell[1]), _is_kept(y, gy, 0.0, last)
        if stays_x or stays_y:
            dx, dy = 0.0 if stays_x else -gx / max(xx, 0.1 * tx), 0.0 if stays_y else -gy / max(yy, 0.1 * ty)
        else:
            # Downhill in any case: what is not convex is made so.
            middle, half = 0.5 * (xx + yy), np.sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
            more = max(0.0, FLAT * (tx + ty) - (middle - half))
            xx, yy = xx + more, yy + more
            cross = xx * yy - xy * xy
            dx, dy = (-yy * gx + xy * gy) / cross, (xy * gx - xx * gy) / cross
        longest = max(abs(dx), abs(dy))
        scale = min(1.0, STRIDE / longest) if longest > 0.0 else 1.0
        before_x, before_y = x, y
        x, y = min(max(x + scale * dx, cell[0]), cell[1]), min(max(y + scale * dy, 0.0), last)
        if abs(x - before_x) < NEAREST and abs(y - before_y) < NEAREST:
            break
    point_at(nodes, x, weights, one)
    point_at(others, y, weights, other)
    return x, y


@kernel
def apart(one, other, distance, normal):  # type: ignore[no-untyped-def]
    """Gap [m] between two places as `point_at` leaves them; `normal` (3,), that of before, is turned to that of now.

    Two strands inside each other are still on the sides on which they met.
    """
    size, along = 0.0, 0.0
    for k in range(3):
        difference = one[0, k] - other[0, k]
        size += difference * difference
        along += difference * normal[k]
    size = np.sqrt(size)
    signed = -size if along < 0.0 and size < distance else size
    if size > 1e-12:
        for k in range(3):
            normal[k] = (one[0, k] - other[0, k]) / signed
    return signed - distance


@kernel
def _is_kept(place, slope, low, high):  # type: ignore[no-untyped-def]
    """Whether a place at an end of where it may be would slide beyond it."""
    return (place <= low and slope > 0.0) or (place >= high and slope < 0.0)


@kernel
def meet(nodes, strands, fraction, gap, normal):  # type: ignore[no-untyped-def]
    """Gaps [m] and normals of all self-contacts, into their rows.

    Their places in `fraction`, after those of all rows, slide along, and their normals after these turn along.
    """
    weights, one, other = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    many = len(strands.distance)
    for c in range(many):
        row, at, was = strands.first + c, len(gap) + 2 * c, len(gap) + 2 * many + 3 * c
        x, y = slide(nodes, nodes, fraction[at], fraction[at + 1], strands.cell[c], weights, one, other)
        # Places that slide into each other have no nearest pair any more: between them is but a bend.
        if abs(_arc_length(strands.s, x) - _arc_length(strands.s, y)) < BEND * strands.distance[c]:
            gap[row], normal[row] = FAR, fraction[was : was + 3]
            continue
        fraction[at], fraction[at + 1] = x, y
        gap[row] = apart(one, other, strands.distance[c], fraction[was : was + 3])
        normal[row] = fraction[was : was + 3]


@kernel
def _arc_length(s, place):  # type: ignore[no-untyped-def]
    node = min(int(place), len(s) - 2)
    return s[node] + (place - node) * (s[node + 1] - s[node])


@kernel
def add_strand_forces(forces, strands, push, fraction, normal):  # type: ignore[no-untyped-def]
    """Add the forces [N] of self-contacts to the nodes (n, 3): on the first place along the normal, on the second against it."""
    weights = np.empty((3, 3))
    for c in range(len(strands.distance)):
        row = strands.first + c
        if push[row] == 0.0:
            continue
        for side in range(2):
            size = push[row] if side == 0 else -push[row]
            first = shares(fraction[len(push) + 2 * c + side], len(forces) - 1, weights)
            for node in range(3):
                for k in range(3):
                    forces[first + node, k] += size * weights[0, node] * normal[row, k]
