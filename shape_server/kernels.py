"""Compiled kernels of the staggered rod: plain functions on arrays, the same names and results as in `numpy_path`.

The rod has n nodes and n-1 segments. A segment carries one frame (unit quaternion) and a length; its third director d3
points from node to node, so positions are sums of lengths times d3, starting from the `base` node. Curvature lives at
the nodes, between the frames of neighbouring segments; a clamp stands in for one of them over half a cell, which holds
position and tangent at the node and keeps second order. The change of a frame is a rotation vector in its own axes,
q <- q exp(theta/2).

Curvature and twist at a node: rho = conj(q_a) q_b (scalar part not negative), sigma = rho_v / (1 + rho_0), kappa =
4 sigma / cell, energy = cell/2 kappa.K kappa with K = diag(law). This measure grows monotonically up to a turn of 2 pi
and agrees with the exact curvature to second order in the cell.

Source: Wiener and Milenkovic parameters for kappa, see Bauchau and Trainelli 2003, "The vectorial parameterization of
rotation"; the staggered quaternion rod after Lang, Linn and Arnold 2011, "Multi-body dynamics simulation of
geometrically exact Cosserat rods". Derivatives were derived here and are checked by differences in the tests.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .chain import carried_forces as carried_forces
from .chain import directors as directors
from .chain import positions as positions
from .chain import retract as retract
from .closing import close as close
from .contact_geometry import contact_geometry as contact_geometry


@njit(cache=True)
def _relative(qa, qb, rho):  # type: ignore[no-untyped-def]
    """Relative rotation conj(qa) qb as (x, y, z, w), with w >= 0."""
    ax, ay, az, aw = -qa[0], -qa[1], -qa[2], qa[3]
    bx, by, bz, bw = qb[0], qb[1], qb[2], qb[3]
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    w = aw * bw - ax * bx - ay * by - az * bz
    sign = 1.0 if w >= 0.0 else -1.0
    rho[0], rho[1], rho[2], rho[3] = sign * x, sign * y, sign * z, sign * w


@njit(cache=True)
def _vertex_energy(qa, qb, cell, law, rho):  # type: ignore[no-untyped-def]
    _relative(qa, qb, rho)
    scale = 1.0 / (1.0 + rho[3])
    total = 0.0
    for i in range(3):
        total += law[i] * (rho[i] * scale) ** 2
    return 8.0 / cell * total


@njit(cache=True)
def _vertex(qa, qb, cell, law, rho, ga, gb, haa, hab, hbb, work):  # type: ignore[no-untyped-def]
    """Gradient and Hessian of one vertex; `work` is (4, 3, 3)."""
    _relative(qa, qb, rho)
    v0, v1, v2, r0 = rho[0], rho[1], rho[2], rho[3]
    inv = 1.0 / (1.0 + r0)
    s0, s1, s2 = v0 * inv, v1 * inv, v2 * inv
    ss = s0 * s0 + s1 * s1 + s2 * s2
    m0, m1, m2 = 4.0 * law[0] * s0 / cell, 4.0 * law[1] * s1 / cell, 4.0 * law[2] * s2 / cell
    b = work[0]
    diagonal = 0.25 * (1.0 - ss)
    b[0, 0], b[0, 1], b[0, 2] = diagonal + 0.5 * s0 * s0, 0.5 * (s0 * s1 - s2), 0.5 * (s0 * s2 + s1)
    b[1, 0], b[1, 1], b[1, 2] = 0.5 * (s0 * s1 + s2), diagonal + 0.5 * s1 * s1, 0.5 * (s1 * s2 - s0)
    b[2, 0], b[2, 1], b[2, 2] = 0.5 * (s0 * s2 - s1), 0.5 * (s1 * s2 + s0), diagonal + 0.5 * s2 * s2
    for i in range(3):
        gb[i] = 4.0 * (b[0, i] * m0 + b[1, i] * m1 + b[2, i] * m2)
        ga[i] = -4.0 * (b[i, 0] * m0 + b[i, 1] * m1 + b[i, 2] * m2)
    scale = 16.0 / cell
    kb, kbt = work[1], work[2]  # K B and K B^T
    for i in range(3):
        for j in range(3):
            kb[i, j] = scale * law[i] * b[i, j]
            kbt[i, j] = scale * law[i] * b[j, i]
    ms = m0 * s0 + m1 * s1 + m2 * s2
    g0, c0, c1, c2 = -ms * inv, m0 * inv, m1 * inv, m2 * inv
    spread = g0 * r0 + c0 * v0 + c1 * v1 + c2 * v2
    cv = c0 * v0 + c1 * v1 + c2 * v2
    p = work[3]
    p0, p1, p2 = g0 * v0 + r0 * c0, g0 * v1 + r0 * c1, g0 * v2 + r0 * c2
    flat = cv - g0 * r0
    p[0, 0], p[0, 1], p[0, 2] = flat, p2, -p1
    p[1, 0], p[1, 1], p[1, 2] = -p2, flat, p0
    p[2, 0], p[2, 1], p[2, 2] = p1, -p0, flat
    half = 0.5 * inv
    for i in range(3):
        vi = rho[i]
        ci = c0 if i == 0 else (c1 if i == 1 else c2)
        for j in range(3):
            vj = rho[j]
            cj = c0 if j == 0 else (c1 if j == 1 else c2)
            bb = b[0, i] * kb[0, j] + b[1, i] * kb[1, j] + b[2, i] * kb[2, j]
            aa = b[i, 0] * kbt[0, j] + b[i, 1] * kbt[1, j] + b[i, 2] * kbt[2, j]
            ab = b[i, 0] * kb[0, j] + b[i, 1] * kb[1, j] + b[i, 2] * kb[2, j]
            hbb[i, j] = bb + half * (vi * gb[j] + gb[i] * vj)
            haa[i, j] = aa - half * (vi * ga[j] + ga[i] * vj)
            hab[i, j] = -ab - half * (vi * gb[j] - ga[i] * vj) - (p[i, j] - ci * vj - vi * cj)
        hbb[i, i] -= spread
        haa[i, i] -= spread


@njit(cache=True)
def elastic_energy(frames, lengths, law, clamp_of_node, clamp_frames):  # type: ignore[no-untyped-def]
    """Energy of bending and twist [J]."""
    count = lengths.shape[0]
    rho = np.empty(4)
    total = 0.0
    for i in range(count + 1):
        clamp = clamp_of_node[i]
        if clamp >= 0:
            if i > 0:
                total += _vertex_energy(frames[i - 1], clamp_frames[clamp], 0.5 * lengths[i - 1], law, rho)
            if i < count:
                total += _vertex_energy(clamp_frames[clamp], frames[i], 0.5 * lengths[i], law, rho)
        elif 0 < i < count:
            total += _vertex_energy(frames[i - 1], frames[i], 0.5 * (lengths[i - 1] + lengths[i]), law, rho)
    return total


@njit(cache=True)
def assemble(frames, axes, lengths, law, clamp_of_node, clamp_frames, carried):  # type: ignore[no-untyped-def]
    """Gradient (n-1, 3), diagonal (n-1, 3, 3) and upper blocks (n-1, 3, 3) of energy less the work of the forces."""
    count = lengths.shape[0]
    gradient = np.empty((count, 3))
    diagonal = np.zeros((count, 3, 3))
    upper = np.zeros((count, 3, 3))
    for j in range(count):
        h = lengths[j]
        n0 = axes[j, 0, 0] * carried[j, 0] + axes[j, 0, 1] * carried[j, 1] + axes[j, 0, 2] * carried[j, 2]
        n1 = axes[j, 1, 0] * carried[j, 0] + axes[j, 1, 1] * carried[j, 1] + axes[j, 1, 2] * carried[j, 2]
        n2 = axes[j, 2, 0] * carried[j, 0] + axes[j, 2, 1] * carried[j, 1] + axes[j, 2, 2] * carried[j, 2]
        gradient[j, 0], gradient[j, 1], gradient[j, 2] = h * n1, -h * n0, 0.0
        diagonal[j, 0, 0] = h * n2
        diagonal[j, 1, 1] = h * n2
        diagonal[j, 0, 2] = diagonal[j, 2, 0] = -0.5 * h * n0
        diagonal[j, 1, 2] = diagonal[j, 2, 1] = -0.5 * h * n1
    rho, ga, gb = np.empty(4), np.empty(3), np.empty(3)
    haa, hab, hbb, work = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((4, 3, 3))
    for i in range(count + 1):
        clamp = clamp_of_node[i]
        if clamp >= 0:
            if i > 0:
                _vertex(frames[i - 1], clamp_frames[clamp], 0.5 * lengths[i - 1], law, rho, ga, gb, haa, hab, hbb, work)
                gradient[i - 1] += ga
                diagonal[i - 1] += haa
            if i < count:
                _vertex(clamp_frames[clamp], frames[i], 0.5 * lengths[i], law, rho, ga, gb, haa, hab, hbb, work)
                gradient[i] += gb
                diagonal[i] += hbb
        elif 0 < i < count:
            cell = 0.5 * (lengths[i - 1] + lengths[i])
            _vertex(frames[i - 1], frames[i], cell, law, rho, ga, gb, haa, hab, hbb, work)
            gradient[i - 1] += ga
            gradient[i] += gb
            diagonal[i - 1] += haa
            diagonal[i] += hbb
            upper[i - 1] = hab
    return gradient, diagonal, upper


@njit(cache=True)
def columns(axes, lengths, base, element, fraction, vector, is_turn):  # type: ignore[no-untyped-def]
    """Border columns (n-1, 3, m): change of each scalar quantity with the rotation of every segment.

    Quantity c is vector[c] . r at `fraction` of segment element[c], or vector[c] . d3 of that segment where `is_turn`.
    """
    count, many = lengths.shape[0], element.shape[0]
    out = np.zeros((count, 3, many))
    for c in range(many):
        e = element[c]
        v0, v1, v2 = vector[c, 0], vector[c, 1], vector[c, 2]
        if is_turn[c]:
            first, last, sign = e, e, 1.0
        elif e >= base:
            first, last, sign = base, e, 1.0
        else:
            first, last, sign = e, base - 1, -1.0
        for j in range(first, last + 1):
            weight = 1.0
            if not is_turn[c]:
                weight = sign * lengths[j]
                if j == e:
                    weight *= fraction[c] if sign > 0 else 1.0 - fraction[c]
            out[j, 0, c] = -weight * (v0 * axes[j, 1, 0] + v1 * axes[j, 1, 1] + v2 * axes[j, 1, 2])
            out[j, 1, c] = weight * (v0 * axes[j, 0, 0] + v1 * axes[j, 0, 1] + v2 * axes[j, 0, 2])
    return out


@njit(cache=True)
def factor_and_solve(diagonal, upper, right):  # type: ignore[no-untyped-def]
    """Solve the symmetric block-tridiagonal system for all right-hand sides.

    Returns:
        (n-1, 3, m) solutions, and the number of negative eigenvalues, counted from the pivots (Sylvester).
    """
    count, many = diagonal.shape[0], right.shape[2]
    inverse = np.empty((count, 3, 3))
    carry = np.empty((count, 3, 3))  # D^-1 U
    out = right.copy()
    block = np.empty((3, 3))
    negative = 0
    for i in range(count):
        for r in range(3):
            for c in range(3):
                block[r, c] = diagonal[i, r, c]
        if i > 0:
            u, g = upper[i - 1], carry[i - 1]
            for r in range(3):
                for c in range(3):
                    block[r, c] -= u[0, r] * g[0, c] + u[1, r] * g[1, c] + u[2, r] * g[2, c]
                for k in range(many):
                    out[i, r, k] -= g[0, r] * out[i - 1, 0, k] + g[1, r] * out[i - 1, 1, k] + g[2, r] * out[i - 1, 2, k]
        negative += _invert(block, inverse[i])
        for r in range(3):
            for c in range(3):
                carry[i, r, c] = inverse[i, r, 0] * upper[i, 0, c] + inverse[i, r, 1] * upper[i, 1, c] + inverse[i, r, 2] * upper[i, 2, c]
    for i in range(count - 1, -1, -1):
        d = inverse[i]
        for k in range(many):
            x, y, z = out[i, 0, k], out[i, 1, k], out[i, 2, k]
            for r in range(3):
                value = d[r, 0] * x + d[r, 1] * y + d[r, 2] * z
                if i + 1 < count:
                    value -= carry[i, r, 0] * out[i + 1, 0, k] + carry[i, r, 1] * out[i + 1, 1, k] + carry[i, r, 2] * out[i + 1, 2, k]
                out[i, r, k] = value
    return out, negative


@njit(cache=True)
def _invert(block, out):  # type: ignore[no-untyped-def]
    """Inverse of a symmetric 3x3 block and the number of its negative eigenvalues, from the signs of the minors."""
    a, b, c = block[0, 0], block[0, 1], block[0, 2]
    d, e, f = block[1, 1], block[1, 2], block[2, 2]
    size = abs(a) + abs(d) + abs(f) + 1e-300
    if abs(a) < 1e-14 * size:
        a = 1e-14 * size
    minor = a * d - b * b
    if abs(minor) < 1e-28 * size * size:
        minor = 1e-28 * size * size
    x, y = c * e - b * f, b * e - c * d
    det = a * (d * f - e * e) + b * x + c * y
    if abs(det) < 1e-42 * size**3:
        det = 1e-42 * size**3
    out[0, 0], out[0, 1], out[0, 2] = (d * f - e * e) / det, x / det, y / det
    out[1, 0], out[1, 1], out[1, 2] = x / det, (a * f - c * c) / det, (b * c - a * e) / det
    out[2, 0], out[2, 1], out[2, 2] = y / det, (b * c - a * e) / det, minor / det
    return (1 if a < 0 else 0) + (1 if minor / a < 0 else 0) + (1 if det / minor < 0 else 0)
