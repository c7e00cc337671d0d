"""Bending and twist at the nodes: energy, gradient and Hessian of the staggered rod, compiled.

The rod has n nodes and n-1 segments. A segment carries one frame (unit quaternion) and a length; its third director d3
points from node to node, so positions are sums of lengths times d3, starting from the `base` node. Curvature lives at
the nodes, between the frames of neighbouring segments; a clamp stands in for one of them over half a cell, which holds
position and tangent at the node and keeps second order. The change of a frame is a rotation vector in its own axes,
q <- q exp(theta/2).

Curvature and twist at a node: rho = conj(q_a) q_b (scalar part not negative), sigma = rho_v / (1 + rho_0), kappa =
4 sigma / cell, energy = cell/2 (kappa - bent).K (kappa - bent) with K = diag(law). This measure grows monotonically up to a
turn of 2 pi and agrees with the exact curvature to second order in the cell.

At a clamp, sigma = rho_v / rho_0 and kappa = 2 sigma / cell over half a cell: that is the curvature of a whole cell about the node whose
other half mirrors this one. With the measure of the other nodes the error would have a term of third order in the cell there;
with this one it has even orders only, and two meshes combine to fourth order (`richardson`).

Source: Wiener and Milenkovic parameters for kappa, see Bauchau and Trainelli 2003, "The vectorial parameterization of
rotation"; the staggered quaternion rod after Lang, Linn and Arnold 2011, "Multi-body dynamics simulation of
geometrically exact Cosserat rods". Derivatives were derived here and are checked by differences in the tests.
"""

from __future__ import annotations

import numpy as np

from .jitted import kernel

INNER, CLAMP = 1.0, 0.0  # kinds of vertices: between two segments, and between a segment and a clamp
LEAST = 1e-6  # of the scalar part at a clamp; half a turn within half a cell is further than any cable bends


@kernel
def elastic_energy(frames, lengths, elastic, clamp_of_node, clamp_frames):  # type: ignore[no-untyped-def]
    """Energy of bending and twist [J]; `elastic` is an `Elastic`."""
    count = lengths.shape[0]
    rho = np.empty(4)
    total = 0.0
    for i in range(count + 1):
        clamp = clamp_of_node[i]
        if clamp >= 0:
            if i > 0:
                cell = 0.5 * lengths[i - 1]
                total += _energy(frames[i - 1], clamp_frames[clamp], cell, CLAMP, elastic.law[i - 1], elastic.bent[i - 1], rho)
            if i < count:
                total += _energy(clamp_frames[clamp], frames[i], 0.5 * lengths[i], CLAMP, elastic.law[i], elastic.bent[i], rho)
        elif 0 < i < count:
            cell = 0.5 * (lengths[i - 1] + lengths[i])
            total += _energy(frames[i - 1], frames[i], cell, INNER, elastic.node_law[i], elastic.node_bent[i], rho)
    return total


@kernel
def strain_scale(scalar, cell, kind):  # type: ignore[no-untyped-def]
    """Curvature per vector part of the relative rotation whose scalar part is given [1/m]."""
    return (2.0 + 2.0 * kind) / (cell * max(kind + scalar, LEAST))


@kernel
def relative(qa, qb, rho):  # type: ignore[no-untyped-def]
    """Relative rotation conj(qa) qb as (x, y, z, w), with w >= 0."""
    ax, ay, az, aw = -qa[0], -qa[1], -qa[2], qa[3]
    bx, by, bz, bw = qb[0], qb[1], qb[2], qb[3]
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    w = aw * bw - ax * bx - ay * by - az * bz
    sign = 1.0 if w >= 0.0 else -1.0
    rho[0], rho[1], rho[2], rho[3] = sign * x, sign * y, sign * z, sign * w


@kernel
def _energy(qa, qb, cell, kind, law, bent, rho):  # type: ignore[no-untyped-def]
    relative(qa, qb, rho)
    scale = strain_scale(rho[3], cell, kind)
    total = 0.0
    for i in range(3):
        total += law[i] * (rho[i] * scale - bent[i]) ** 2
    return 0.5 * cell * total


@kernel
def vertex(qa, qb, cell, kind, law, bent, rho, ga, gb, haa, hab, hbb, work):  # type: ignore[no-untyped-def]
    """Gradient and Hessian of one vertex of a `kind`, `INNER` or `CLAMP`; `work` is (4, 3, 3).

    With sigma = rho_v / (kind + rho_0) and kappa = factor sigma / cell, d sigma = B theta_b - B^T theta_a,
    B = (rho_0 / (kind + rho_0) I + [sigma] + sigma sigma^T) / 2.
    """
    relative(qa, qb, rho)
    v0, v1, v2, r0 = rho[0], rho[1], rho[2], max(rho[3], LEAST - kind)
    inv, factor = 1.0 / (kind + r0), 2.0 + 2.0 * kind
    s0, s1, s2 = v0 * inv, v1 * inv, v2 * inv
    m0 = law[0] * (factor * s0 / cell - bent[0])
    m1 = law[1] * (factor * s1 / cell - bent[1])
    m2 = law[2] * (factor * s2 / cell - bent[2])
    b = work[0]
    diagonal = 0.5 * r0 * inv
    b[0, 0], b[0, 1], b[0, 2] = diagonal + 0.5 * s0 * s0, 0.5 * (s0 * s1 - s2), 0.5 * (s0 * s2 + s1)
    b[1, 0], b[1, 1], b[1, 2] = 0.5 * (s0 * s1 + s2), diagonal + 0.5 * s1 * s1, 0.5 * (s1 * s2 - s0)
    b[2, 0], b[2, 1], b[2, 2] = 0.5 * (s0 * s2 - s1), 0.5 * (s1 * s2 + s0), diagonal + 0.5 * s2 * s2
    for i in range(3):
        gb[i] = factor * (b[0, i] * m0 + b[1, i] * m1 + b[2, i] * m2)
        ga[i] = -factor * (b[i, 0] * m0 + b[i, 1] * m1 + b[i, 2] * m2)
    scale = factor * factor / cell
    kb, kbt = work[1], work[2]  # K B and K B^T
    for i in range(3):
        for j in range(3):
            kb[i, j] = scale * law[i] * b[i, j]
            kbt[i, j] = scale * law[i] * b[j, i]
    ms = m0 * s0 + m1 * s1 + m2 * s2
    share = 0.25 * factor * inv
    g0, c0, c1, c2 = -ms * share, m0 * share, m1 * share, m2 * share
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
