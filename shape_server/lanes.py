"""Newton steps of many cables at once, one in each lane of the processor's vector registers; compiled.

The formulas of `vertices`, `elimination` and `closing`, for what most sweeps are about: cables without stretch and contacts, clamped at
both ends, on as many segments each. Every quantity is a row of `LANES` numbers, one of every cable, and every inner loop runs over such
a row, without a branch, so that LLVM turns it into vector instructions. It does only if

* a division cannot raise (`error_model="numpy"`),
* rows are told apart by arrays of one axis, `here`, `before` and `after`, and by constant offsets in them,
* a row has sixteen numbers or more: for less it does not look whether arrays overlap.

The frames of both clamps stand in line with those of the segments, so that every node is a vertex between two rows of frames. Each vertex
is assembled and the segment before it eliminated at once; nothing but the factors is kept. Per cable and Newton step at 40 segments this
takes 1.2 us where the general code takes 19 us (AVX-512): a factor of three and a half is due to assembling and eliminating in one pass.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .lane_rows import LANES, column, conjugate, dot, form, four, larger, mixed, place_nodes, product, put, solved, three, weighted
from .vertices import CLAMP, INNER, LEAST

F8, F9, F10, F11, F12, F13, F14, F15 = (math.factorial(k) for k in range(8, 16))
# Where the rows of every segment and clamp begin.
FRAME = 0  # (4)
CELL, LAW, BENT = 4 * LANES, 5 * LANES, 8 * LANES  # (1) m, (3) N m^2, (3) 1/m, of the vertex between this frame and the next
LENGTH, WEIGHT = 11 * LANES, 12 * LANES  # (1) m, (3) N, weight of all nodes beyond
INVERSE, CARRY = 15 * LANES, 21 * LANES  # (6) and (9), as in `elimination`
RIGHT = 30 * LANES  # (4, 3) right-hand sides: three of the border, and the gradient
COLUMN = 42 * LANES  # (3, 2) of the border, about d1 and d2
COUPLE = 48 * LANES  # (9) between this frame and the next
CURVE, SLOPE = 57 * LANES, 63 * LANES  # (6) and (3), of the vertex, about the frame after it
CURVE_BEFORE, SLOPE_BEFORE = 66 * LANES, 72 * LANES  # (6) and (3), about the frame before it
WIDTH = 75 * LANES
# Where the rows of the cables as a whole begin.
SCHUR, MISS, FORCE, CHORD = 0, 9 * LANES, 12 * LANES, 15 * LANES  # (3, 3), (3) m, (3) N, (3) m
INERTIA = 18 * LANES  # (1) negative eigenvalues of H and positive ones of S
LONGEST, MOVES = 19 * LANES, 20 * LANES  # (1) rad, of the step; (1) one, or zero when done
SUMS = 21 * LANES


@njit(cache=True, error_model="numpy")
def follow_lanes(vertex, lengths, weight, origin, chord, frames, force, short, steps):  # type: ignore[no-untyped-def]
    """Newton steps of blocks of `LANES` cables until one is shorter than `short` [rad]; frames and forces are changed in place.

    In the last axis of every array each number stands in line with that of the other cables of its block.

    Args:
        vertex: (blocks, n, 7 LANES) Length [m], stiffness (3) [N m^2] and natural curvature (3) [1/m] of every node's cell.
        lengths: (blocks, n-1, LANES) [m].
        weight: (blocks, n-1, 3 LANES) [N] Load of all nodes beyond a segment.
        origin: (blocks, 3 LANES) [m] First clamp.
        chord: (blocks, 3 LANES) [m] From the first clamp to the last.
        frames: (blocks, n+1, 4 LANES) Of the first clamp, every segment, the last clamp.
        force: (blocks, 3 LANES) [N] Of the last clamp.
        short: [rad] A step shorter than this is the last one.
        steps: How many at most.

    Returns:
        Nodes (cables, n, 3) [m], and (cables,) 1 at a stable equilibrium, 0 at another, -1 if no step became short.
    """
    blocks, count = lengths.shape[0], lengths.shape[1]
    nodes, verdict = np.empty((blocks * LANES, count + 1, 3)), np.full(blocks * LANES, -1)
    work, sums = np.zeros((count + 2, WIDTH)), np.empty(SUMS)
    for k in range(blocks):
        sums[FORCE:CHORD], sums[CHORD:INERTIA], sums[MOVES:] = force[k], chord[k], 1.0
        work[:, :CELL] = frames[k]
        work[:-1, CELL:LENGTH] = vertex[k]
        work[1:-1, LENGTH:WEIGHT], work[1:-1, WEIGHT:INVERSE] = lengths[k], weight[k]
        left = steps
        while left > 0:
            _step(work, sums)
            left = left - 1 if _judge(sums, verdict[k * LANES : (k + 1) * LANES], short) else 0
        frames[k], force[k] = work[:, :CELL], sums[FORCE:CHORD]
        place_nodes(origin[k], lengths[k], frames[k], nodes[k * LANES : (k + 1) * LANES])
    return nodes, verdict


@njit(cache=True)
def _judge(sums, verdict, short):  # type: ignore[no-untyped-def]
    """Stop the cables whose step was short, or too long to go on; whether others are left."""
    left = False
    for lane in range(LANES):
        if sums[MOVES + lane] > 0.0 and not sums[LONGEST + lane] < 1.0:
            sums[MOVES + lane] = 0.0
        elif sums[MOVES + lane] > 0.0 and sums[LONGEST + lane] < short:
            sums[MOVES + lane], verdict[lane] = 0.0, 1 if sums[INERTIA + lane] == 3.0 else 0
        left = left or sums[MOVES + lane] > 0.0
    return left


@njit(cache=True, error_model="numpy")
def _step(work, sums):  # type: ignore[no-untyped-def]
    """One Newton step of every cable that still moves."""
    last = len(work) - 1
    sums[SCHUR:MISS] = 0.0
    sums[MISS:FORCE] = -sums[CHORD:INERTIA]
    sums[INERTIA:MOVES] = 0.0
    _vertex(work[0], work[1], CLAMP)
    for i in range(1, last):
        _vertex(work[i], work[i + 1], INNER if i + 1 < last else CLAMP)
        _eliminate(work[i - 1], work[i], sums)
    for i in range(last - 1, 0, -1):
        _substitute(work[i], work[i + 1], sums)
    _close(sums)
    for i in range(1, last):
        _turn(work[i], sums)


@njit(cache=True, error_model="numpy")
def _vertex(here, after, kind):  # type: ignore[no-untyped-def]
    """Gradient and Hessian of the vertex between two frames, see `vertices`."""
    factor = 2.0 + 2.0 * kind
    for lane in range(LANES):
        x, y, z, w = product(conjugate(four(here, FRAME, lane)), four(after, FRAME, lane))
        sign = 1.0 if w >= 0.0 else -1.0
        v, r0 = (sign * x, sign * y, sign * z), larger(sign * w, LEAST - kind)
        cell, law, bent = here[CELL + lane], three(here, LAW, lane), three(here, BENT, lane)
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
        put(here, SLOPE, b, lane)
        put(here, SLOPE_BEFORE, a, lane)
        x = form(stiff, col0, col0) + 2.0 * half * v[0] * b[0] - spread
        y = form(stiff, col0, col1) + half * (v[0] * b[1] + b[0] * v[1])
        z = form(stiff, col0, col2) + half * (v[0] * b[2] + b[0] * v[2])
        put(here, CURVE, (x, y, z), lane)
        x = form(stiff, col1, col1) + 2.0 * half * v[1] * b[1] - spread
        y = form(stiff, col1, col2) + half * (v[1] * b[2] + b[1] * v[2])
        z = form(stiff, col2, col2) + 2.0 * half * v[2] * b[2] - spread
        put(here, CURVE + 3 * LANES, (x, y, z), lane)
        x = form(stiff, row0, row0) - 2.0 * half * v[0] * a[0] - spread
        y = form(stiff, row0, row1) - half * (v[0] * a[1] + a[0] * v[1])
        z = form(stiff, row0, row2) - half * (v[0] * a[2] + a[0] * v[2])
        put(here, CURVE_BEFORE, (x, y, z), lane)
        x = form(stiff, row1, row1) - 2.0 * half * v[1] * a[1] - spread
        y = form(stiff, row1, row2) - half * (v[1] * a[2] + a[1] * v[2])
        z = form(stiff, row2, row2) - 2.0 * half * v[2] * a[2] - spread
        put(here, CURVE_BEFORE + 3 * LANES, (x, y, z), lane)
        x = mixed(form(stiff, row0, col0), half, v[0], v[0], a[0], b[0], c[0], c[0], flat)
        y = mixed(form(stiff, row0, col1), half, v[0], v[1], a[0], b[1], c[0], c[1], p2)
        z = mixed(form(stiff, row0, col2), half, v[0], v[2], a[0], b[2], c[0], c[2], -p1)
        put(here, COUPLE, (x, y, z), lane)
        x = mixed(form(stiff, row1, col0), half, v[1], v[0], a[1], b[0], c[1], c[0], -p2)
        y = mixed(form(stiff, row1, col1), half, v[1], v[1], a[1], b[1], c[1], c[1], flat)
        z = mixed(form(stiff, row1, col2), half, v[1], v[2], a[1], b[2], c[1], c[2], p0)
        put(here, COUPLE + 3 * LANES, (x, y, z), lane)
        x = mixed(form(stiff, row2, col0), half, v[2], v[0], a[2], b[0], c[2], c[0], p1)
        y = mixed(form(stiff, row2, col1), half, v[2], v[1], a[2], b[1], c[2], c[1], -p0)
        z = mixed(form(stiff, row2, col2), half, v[2], v[2], a[2], b[2], c[2], c[2], flat)
        put(here, COUPLE + 6 * LANES, (x, y, z), lane)


@njit(cache=True, error_model="numpy")
def _eliminate(before, here, sums):  # type: ignore[no-untyped-def]
    """Diagonal block and right-hand sides of a segment, less what the segment before it leaves there; its inverse and what it carries."""
    for lane in range(LANES):
        x, y, z, w = four(here, FRAME, lane)
        h, load = here[LENGTH + lane], three(here, WEIGHT, lane)
        pull = load[0] + sums[FORCE + lane], load[1] + sums[FORCE + LANES + lane], load[2] + sums[FORCE + 2 * LANES + lane]
        d1 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
        d2 = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
        d3 = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
        n0, n1, n2 = h * dot(d1, pull), h * dot(d2, pull), h * dot(d3, pull)
        u0, u1, u2 = column(before, COUPLE, lane), column(before, COUPLE + LANES, lane), column(before, COUPLE + 2 * LANES, lane)
        g0, g1, g2 = column(before, CARRY, lane), column(before, CARRY + LANES, lane), column(before, CARRY + 2 * LANES, lane)
        a = before[CURVE + lane] + here[CURVE_BEFORE + lane] + n2 - dot(u0, g0)
        b = before[CURVE + LANES + lane] + here[CURVE_BEFORE + LANES + lane] - dot(u0, g1)
        c = before[CURVE + 2 * LANES + lane] + here[CURVE_BEFORE + 2 * LANES + lane] - 0.5 * n0 - dot(u0, g2)
        d = before[CURVE + 3 * LANES + lane] + here[CURVE_BEFORE + 3 * LANES + lane] + n2 - dot(u1, g1)
        e = before[CURVE + 4 * LANES + lane] + here[CURVE_BEFORE + 4 * LANES + lane] - 0.5 * n1 - dot(u1, g2)
        f = before[CURVE + 5 * LANES + lane] + here[CURVE_BEFORE + 5 * LANES + lane] - dot(u2, g2)
        sums[MISS + lane] += h * d3[0]
        sums[MISS + LANES + lane] += h * d3[1]
        sums[MISS + 2 * LANES + lane] += h * d3[2]
        s, t = three(before, SLOPE, lane), three(here, SLOPE_BEFORE, lane)
        put(here, COLUMN, (-h * d2[0], h * d1[0], -h * d2[1]), lane)
        put(here, COLUMN + 3 * LANES, (h * d1[1], -h * d2[2], h * d1[2]), lane)
        x0, x1, x2, x3 = _right_hand_sides(before, lane)
        put(here, RIGHT, (-h * d2[0] - dot(g0, x0), h * d1[0] - dot(g1, x0), -dot(g2, x0)), lane)
        put(here, RIGHT + 3 * LANES, (-h * d2[1] - dot(g0, x1), h * d1[1] - dot(g1, x1), -dot(g2, x1)), lane)
        put(here, RIGHT + 6 * LANES, (-h * d2[2] - dot(g0, x2), h * d1[2] - dot(g1, x2), -dot(g2, x2)), lane)
        slope = s[0] + t[0] + n1 - dot(g0, x3), s[1] + t[1] - n0 - dot(g1, x3), s[2] + t[2] - dot(g2, x3)
        put(here, RIGHT + 9 * LANES, slope, lane)
        size = abs(a) + abs(d) + abs(f) + 1e-300
        a = a if abs(a) >= 1e-14 * size else 1e-14 * size
        minor = a * d - b * b
        minor = minor if abs(minor) >= 1e-28 * size * size else 1e-28 * size * size
        p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
        det = a * p + b * q + c * r
        det = det if abs(det) >= 1e-42 * size * size * size else 1e-42 * size * size * size
        sums[INERTIA + lane] += (1.0 if a < 0.0 else 0.0) + (1.0 if minor * a < 0.0 else 0.0) + (1.0 if det * minor < 0.0 else 0.0)
        scale = 1.0 / det
        i0, i1, i2 = scale * p, scale * q, scale * r
        i3, i4, i5 = scale * (a * f - c * c), scale * (b * c - a * e), scale * minor
        put(here, INVERSE, (i0, i1, i2), lane)
        put(here, INVERSE + 3 * LANES, (i3, i4, i5), lane)
        u0, u1, u2 = three(here, COUPLE, lane), three(here, COUPLE + 3 * LANES, lane), three(here, COUPLE + 6 * LANES, lane)
        put(here, CARRY, weighted(i0, u0, i1, u1, i2, u2), lane)
        put(here, CARRY + 3 * LANES, weighted(i1, u0, i3, u1, i4, u2), lane)
        put(here, CARRY + 6 * LANES, weighted(i2, u0, i4, u1, i5, u2), lane)


@njit(cache=True, error_model="numpy")
def _substitute(here, after, sums):  # type: ignore[no-untyped-def]
    """Solution of a segment from that of the next, and its share of the Schur complement C^T H^-1 (C, gradient)."""
    for lane in range(LANES):
        inverse, inverse_2 = three(here, INVERSE, lane), three(here, INVERSE + 3 * LANES, lane)
        g0, g1, g2 = three(here, CARRY, lane), three(here, CARRY + 3 * LANES, lane), three(here, CARRY + 6 * LANES, lane)
        r0, r1, r2, r3 = _right_hand_sides(here, lane)
        y0, y1, y2, y3 = _right_hand_sides(after, lane)
        x0 = solved(inverse, inverse_2, r0, g0, g1, g2, y0)
        x1 = solved(inverse, inverse_2, r1, g0, g1, g2, y1)
        x2 = solved(inverse, inverse_2, r2, g0, g1, g2, y2)
        x3 = solved(inverse, inverse_2, r3, g0, g1, g2, y3)
        put(here, RIGHT, x0, lane)
        put(here, RIGHT + 3 * LANES, x1, lane)
        put(here, RIGHT + 6 * LANES, x2, lane)
        put(here, RIGHT + 9 * LANES, x3, lane)
        c, d = three(here, COLUMN, lane), three(here, COLUMN + 3 * LANES, lane)
        sums[SCHUR + lane] += c[0] * x0[0] + c[1] * x0[1]
        sums[SCHUR + LANES + lane] += c[0] * x1[0] + c[1] * x1[1]
        sums[SCHUR + 2 * LANES + lane] += c[2] * x1[0] + d[0] * x1[1]
        sums[SCHUR + 3 * LANES + lane] += c[0] * x2[0] + c[1] * x2[1]
        sums[SCHUR + 4 * LANES + lane] += c[2] * x2[0] + d[0] * x2[1]
        sums[SCHUR + 5 * LANES + lane] += d[1] * x2[0] + d[2] * x2[1]
        sums[SCHUR + 6 * LANES + lane] += c[0] * x3[0] + c[1] * x3[1]
        sums[SCHUR + 7 * LANES + lane] += c[2] * x3[0] + d[0] * x3[1]
        sums[SCHUR + 8 * LANES + lane] += d[1] * x3[0] + d[2] * x3[1]


@njit(cache=True, error_model="numpy")
def _close(sums):  # type: ignore[no-untyped-def]
    """Change of the force of the last clamp, which takes the place of the miss; its inertia joins that of the segments."""
    for lane in range(LANES):
        a, b, d = three(sums, SCHUR, lane)
        c, e, f = three(sums, SCHUR + 3 * LANES, lane)
        y, miss = three(sums, SCHUR + 6 * LANES, lane), three(sums, MISS, lane)
        y = y[0] - miss[0], y[1] - miss[1], y[2] - miss[2]
        minor, p, q, r = a * d - b * b, d * f - e * e, c * e - b * f, b * e - c * d
        det = a * p + b * q + c * r
        scale, beside = 1.0 / det, b * c - a * e
        change = weighted(scale * y[0], (p, q, r), scale * y[1], (q, a * f - c * c, beside), scale * y[2], (r, beside, minor))
        sums[INERTIA + lane] += (1.0 if a > 0.0 else 0.0) + (1.0 if minor * a > 0.0 else 0.0) + (1.0 if det * minor > 0.0 else 0.0)
        put(sums, MISS, change, lane)
        moves, force = sums[MOVES + lane], three(sums, FORCE, lane)
        put(sums, FORCE, (force[0] + moves * change[0], force[1] + moves * change[1], force[2] + moves * change[2]), lane)


@njit(cache=True, error_model="numpy")
def _turn(here, sums):  # type: ignore[no-untyped-def]
    """Turn a frame by its part of the step; sine and cosine are series, exact to rounding for turns of 1 rad about each axis."""
    for lane in range(LANES):
        x0, x1, x2, x3 = _right_hand_sides(here, lane)
        change, moves = three(sums, MISS, lane), 0.5 * sums[MOVES + lane]
        t = weighted(change[0], x0, change[1], x1, change[2], x2)
        t = t[0] - x3[0], t[1] - x3[1], t[2] - x3[2]
        sums[LONGEST + lane] = larger(larger(sums[LONGEST + lane], abs(t[0])), larger(abs(t[1]), abs(t[2])))
        t = moves * t[0], moves * t[1], moves * t[2]
        a = dot(t, t)
        sine = 1.0 - a * (1 / 6 - a * (1 / 120 - a * (1 / 5040 - a * (1 / F9 - a * (1 / F11 - a * (1 / F13 - a * (1 / F15)))))))
        cosine = 1.0 - a * (1 / 2 - a * (1 / 24 - a * (1 / 720 - a * (1 / F8 - a * (1 / F10 - a * (1 / F12 - a * (1 / F14)))))))
        x, y, z, w = product(four(here, FRAME, lane), (sine * t[0], sine * t[1], sine * t[2], cosine))
        scale = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
        put(here, FRAME, (scale * x, scale * y, scale * z), lane)
        here[FRAME + 3 * LANES + lane] = scale * w


@njit(cache=True)
def _right_hand_sides(rows, lane):  # type: ignore[no-untyped-def]
    return (
        three(rows, RIGHT, lane),
        three(rows, RIGHT + 3 * LANES, lane),
        three(rows, RIGHT + 6 * LANES, lane),
        three(rows, RIGHT + 9 * LANES, lane),
    )
