"""One vertex and one segment of a chain at a time, in tuples of numbers: what `clamped` and `lanes` do in every step; compiled.

`assembly` takes its vertices from here. The formulas of `vertices`, `elimination` and `closing`. The large ones are inlined by numba and
not by LLVM, which would leave a call in the loops of `lanes` and no vectors.
"""

from __future__ import annotations

import math

from .jitted import inlined, kernel
from .vertices import LEAST

F8, F9, F10, F11, F12, F13, F14, F15 = (math.factorial(k) for k in range(8, 16))


@kernel
def larger(a, b):  # type: ignore[no-untyped-def]
    """The larger number."""
    return a if a > b else b


@kernel
def dot(a, b):  # type: ignore[no-untyped-def]
    """Product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def cross(a, b):  # type: ignore[no-untyped-def]
    """Product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined
def three(values, j):  # type: ignore[no-untyped-def]
    """Row j of an array (n, 3), as numbers: a row as an array would be counted in and out."""
    return values[j, 0], values[j, 1], values[j, 2]


@kernel
def scaled(a, x):  # type: ignore[no-untyped-def]
    """Product a x of a number and a vector."""
    return a * x[0], a * x[1], a * x[2]


@kernel
def moved(x, a, y):  # type: ignore[no-untyped-def]
    """Sum x + a y of two vectors."""
    return x[0] + a * y[0], x[1] + a * y[1], x[2] + a * y[2]


@kernel
def weighted(a, x, b, y, c, z):  # type: ignore[no-untyped-def]
    """Sum a x + b y + c z of three vectors."""
    return a * x[0] + b * y[0] + c * z[0], a * x[1] + b * y[1] + c * z[1], a * x[2] + b * y[2] + c * z[2]


@kernel
def form(k, a, b):  # type: ignore[no-untyped-def]
    """Product a . K b with K = diag(k)."""
    return k[0] * a[0] * b[0] + k[1] * a[1] * b[1] + k[2] * a[2] * b[2]


@kernel
def mixed(form, half, vi, vj, ai, bj, ci, cj, p):  # type: ignore[no-untyped-def]
    """Entry of the block of a vertex between its two frames, see `vertices`."""
    return -form - half * (vi * bj - ai * vj) - (p - ci * vj - vi * cj)


@kernel
def solved(inverse, inverse_2, r, g0, g1, g2, y):  # type: ignore[no-untyped-def]
    """Symmetric inverse, by its two halves, times r, less the rows g times y."""
    first = inverse[0] * r[0] + inverse[1] * r[1] + inverse[2] * r[2] - dot(g0, y)
    second = inverse[1] * r[0] + inverse_2[0] * r[1] + inverse_2[1] * r[2] - dot(g1, y)
    return first, second, inverse[2] * r[0] + inverse_2[1] * r[1] + inverse_2[2] * r[2] - dot(g2, y)


@kernel
def product(a, b):  # type: ignore[no-untyped-def]
    """Of two quaternions."""
    return (
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
        a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    )


@kernel
def conjugate(a):  # type: ignore[no-untyped-def]
    """Of a quaternion."""
    return -a[0], -a[1], -a[2], a[3]


@inlined
def vertex_terms(q_before, q_after, cell, law, bent, kind):  # type: ignore[no-untyped-def]
    """Gradient and Hessian of the vertex between two frames, see `vertices`.

    Returns:
        Slopes (3) about the frame before and about the one after; the two symmetric blocks (xx, xy, xz), (yy, yz, zz), about the frame
        before and about the one after; the rows of the block between them.
    """
    factor = 2.0 + 2.0 * kind
    x, y, z, w = product(conjugate(q_before), q_after)
    sign = 1.0 if w >= 0.0 else -1.0
    v, r0 = (sign * x, sign * y, sign * z), larger(sign * w, LEAST - kind)
    inv = 1.0 / (kind + r0)
    s0, s1, s2 = inv * v[0], inv * v[1], inv * v[2]
    over = factor / cell
    m = law[0] * (over * s0 - bent[0]), law[1] * (over * s1 - bent[1]), law[2] * (over * s2 - bent[2])
    diagonal = 0.5 * r0 * inv
    row0 = diagonal + 0.5 * s0 * s0, 0.5 * (s0 * s1 - s2), 0.5 * (s0 * s2 + s1)
    row1 = 0.5 * (s0 * s1 + s2), diagonal + 0.5 * s1 * s1, 0.5 * (s1 * s2 - s0)
    row2 = 0.5 * (s0 * s2 - s1), 0.5 * (s1 * s2 + s0), diagonal + 0.5 * s2 * s2
    col0, col1, col2 = (row0[0], row1[0], row2[0]), (row0[1], row1[1], row2[1]), (row0[2], row1[2], row2[2])
    b = factor * dot(col0, m), factor * dot(col1, m), factor * dot(col2, m)
    a = -factor * dot(row0, m), -factor * dot(row1, m), -factor * dot(row2, m)
    scale, half, share = factor * over, 0.5 * inv, 0.25 * factor * inv
    stiff = scale * law[0], scale * law[1], scale * law[2]
    g, c = -share * (m[0] * s0 + m[1] * s1 + m[2] * s2), (share * m[0], share * m[1], share * m[2])
    spread, flat = g * r0 + dot(c, v), dot(c, v) - g * r0
    p0, p1, p2 = g * v[0] + r0 * c[0], g * v[1] + r0 * c[1], g * v[2] + r0 * c[2]
    before, after = own_block(stiff, (row0, row1, row2), -half, v, a, spread), own_block(stiff, (col0, col1, col2), half, v, b, spread)
    couple_x = (
        mixed(form(stiff, row0, col0), half, v[0], v[0], a[0], b[0], c[0], c[0], flat),
        mixed(form(stiff, row0, col1), half, v[0], v[1], a[0], b[1], c[0], c[1], p2),
        mixed(form(stiff, row0, col2), half, v[0], v[2], a[0], b[2], c[0], c[2], -p1),
    )
    couple_y = (
        mixed(form(stiff, row1, col0), half, v[1], v[0], a[1], b[0], c[1], c[0], -p2),
        mixed(form(stiff, row1, col1), half, v[1], v[1], a[1], b[1], c[1], c[1], flat),
        mixed(form(stiff, row1, col2), half, v[1], v[2], a[1], b[2], c[1], c[2], p0),
    )
    couple_z = (
        mixed(form(stiff, row2, col0), half, v[2], v[0], a[2], b[0], c[2], c[0], p1),
        mixed(form(stiff, row2, col1), half, v[2], v[1], a[2], b[1], c[2], c[1], -p0),
        mixed(form(stiff, row2, col2), half, v[2], v[2], a[2], b[2], c[2], c[2], flat),
    )
    return (a, b), before, after, (couple_x, couple_y, couple_z)


@inlined
def own_block(stiff, sides, half, v, slope, spread):  # type: ignore[no-untyped-def]
    """Symmetric block (xx, xy, xz), (yy, yz, zz) of a vertex about one of its frames."""
    x, y, z = sides
    first = (
        form(stiff, x, x) + 2.0 * half * v[0] * slope[0] - spread,
        form(stiff, x, y) + half * (v[0] * slope[1] + slope[0] * v[1]),
        form(stiff, x, z) + half * (v[0] * slope[2] + slope[0] * v[2]),
    )
    second = (
        form(stiff, y, y) + 2.0 * half * v[1] * slope[1] - spread,
        form(stiff, y, z) + half * (v[1] * slope[2] + slope[1] * v[2]),
        form(stiff, z, z) + 2.0 * half * v[2] * slope[2] - spread,
    )
    return first, second


@inlined
def eliminated(frame, h, pull, before, own):  # type: ignore[no-untyped-def]
    """A segment, less what the segment before it leaves there.

    Args:
        frame: Its quaternion.
        h: [m] Its length.
        pull: (3) [N] Force that it hands on.
        before: Of the segment before: the columns of its couple and of what it carries, its curve, slope and right-hand sides.
        own: Curve and slope that the vertex after it adds, and the rows of its couple.

    Returns:
        Inverse (6) in two halves, rows of what it carries, right-hand sides (4, 3), border columns (6) in two halves, the
        vector from its first node to its last [m], and how many of its pivots are negative.
    """
    x, y, z, w = frame
    (u0, u1, u2), (g0, g1, g2), curve, s, (x0, x1, x2, x3) = before
    curve_before, t, couple = own
    d1 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    d2 = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    d3 = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    n0, n1, n2 = h * dot(d1, pull), h * dot(d2, pull), h * dot(d3, pull)
    a = curve[0][0] + curve_before[0][0] + n2 - dot(u0, g0)
    b = curve[0][1] + curve_before[0][1] - dot(u0, g1)
    c = curve[0][2] + curve_before[0][2] - 0.5 * n0 - dot(u0, g2)
    d = curve[1][0] + curve_before[1][0] + n2 - dot(u1, g1)
    e = curve[1][1] + curve_before[1][1] - 0.5 * n1 - dot(u1, g2)
    f = curve[1][2] + curve_before[1][2] - dot(u2, g2)
    column = (-h * d2[0], h * d1[0], -h * d2[1]), (h * d1[1], -h * d2[2], h * d1[2])
    right = (
        (-h * d2[0] - dot(g0, x0), h * d1[0] - dot(g1, x0), -dot(g2, x0)),
        (-h * d2[1] - dot(g0, x1), h * d1[1] - dot(g1, x1), -dot(g2, x1)),
        (-h * d2[2] - dot(g0, x2), h * d1[2] - dot(g1, x2), -dot(g2, x2)),
        (s[0] + t[0] + n1 - dot(g0, x3), s[1] + t[1] - n0 - dot(g1, x3), s[2] + t[2] - dot(g2, x3)),
    )
    size = abs(a) + abs(d) + abs(f) + 1e-300
    a = a if abs(a) >= 1e-14 * size else 1e-14 * size
    minor = a * d - b * b
    minor = minor if abs(minor) >= 1e-28 * size * size else 1e-28 * size * size
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    det = a * p + b * q + c * r
    det = det if abs(det) >= 1e-42 * size * size * size else 1e-42 * size * size * size
    negative = (1.0 if a < 0.0 else 0.0) + (1.0 if minor * a < 0.0 else 0.0) + (1.0 if det * minor < 0.0 else 0.0)
    scale = 1.0 / det
    i0, i1, i2 = scale * p, scale * q, scale * r
    i3, i4, i5 = scale * (a * f - c * c), scale * (b * c - a * e), scale * minor
    u0, u1, u2 = couple
    carry = weighted(i0, u0, i1, u1, i2, u2), weighted(i1, u0, i3, u1, i4, u2), weighted(i2, u0, i4, u1, i5, u2)
    return ((i0, i1, i2), (i3, i4, i5)), carry, right, column, (h * d3[0], h * d3[1], h * d3[2]), negative


@inlined
def substituted(inverse, carry, right, column, after):  # type: ignore[no-untyped-def]
    """Solutions (4, 3) of a segment from those of the next.

    Returns:
        The solutions, and in three threes what the segment adds to C^T H^-1 C, (00, 01, 11) and (02, 12, 22), and to C^T H^-1 gradient.
    """
    g0, g1, g2 = carry
    x0 = solved(inverse[0], inverse[1], right[0], g0, g1, g2, after[0])
    x1 = solved(inverse[0], inverse[1], right[1], g0, g1, g2, after[1])
    x2 = solved(inverse[0], inverse[1], right[2], g0, g1, g2, after[2])
    x3 = solved(inverse[0], inverse[1], right[3], g0, g1, g2, after[3])
    c, d = column
    first = c[0] * x0[0] + c[1] * x0[1], c[0] * x1[0] + c[1] * x1[1], c[2] * x1[0] + d[0] * x1[1]
    second = c[0] * x2[0] + c[1] * x2[1], c[2] * x2[0] + d[0] * x2[1], d[1] * x2[0] + d[2] * x2[1]
    third = c[0] * x3[0] + c[1] * x3[1], c[2] * x3[0] + d[0] * x3[1], d[1] * x3[0] + d[2] * x3[1]
    return (x0, x1, x2, x3), first, second, third


@inlined
def closed(first, second, third, miss):  # type: ignore[no-untyped-def]
    """Change (3) [N] of the force of the last clamp, and how many eigenvalues of the Schur complement are positive."""
    a, b, d = first
    c, e, f = second
    y0, y1, y2 = third[0] - miss[0], third[1] - miss[1], third[2] - miss[2]
    minor, p, q, r = a * d - b * b, d * f - e * e, c * e - b * f, b * e - c * d
    det = a * p + b * q + c * r
    scale, beside = 1.0 / det, b * c - a * e
    change = weighted(scale * y0, (p, q, r), scale * y1, (q, a * f - c * c, beside), scale * y2, (r, beside, minor))
    positive = (1.0 if a > 0.0 else 0.0) + (1.0 if minor * a > 0.0 else 0.0) + (1.0 if det * minor > 0.0 else 0.0)
    return change, positive


@inlined
def turn_of(solutions, change):  # type: ignore[no-untyped-def]
    """Rotation vector (3) [rad] of a segment in this step."""
    x0, x1, x2, x3 = solutions
    t = weighted(change[0], x0, change[1], x1, change[2], x2)
    return t[0] - x3[0], t[1] - x3[1], t[2] - x3[2]


@inlined
def turned(frame, half):  # type: ignore[no-untyped-def]
    """Quaternion turned by twice `half` (3) [rad]; sine and cosine are series, exact to rounding for turns of 1 rad about each axis."""
    a = dot(half, half)
    sine = 1.0 - a * (1 / 6 - a * (1 / 120 - a * (1 / 5040 - a * (1 / F9 - a * (1 / F11 - a * (1 / F13 - a * (1 / F15)))))))
    cosine = 1.0 - a * (1 / 2 - a * (1 / 24 - a * (1 / 720 - a * (1 / F8 - a * (1 / F10 - a * (1 / F12 - a * (1 / F14)))))))
    x, y, z, w = product(frame, (sine * half[0], sine * half[1], sine * half[2], cosine))
    scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    return scale * x, scale * y, scale * z, scale * w
