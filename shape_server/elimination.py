"""The block-tridiagonal part of the system: border columns, and elimination of the segments one after the other, compiled."""

from __future__ import annotations

import numpy as np

from .jitted import kernel


@kernel
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


@kernel
def factor_and_solve(diagonal, upper, right):  # type: ignore[no-untyped-def]
    """Solve the symmetric block-tridiagonal system for all right-hand sides (n-1, 3, m), which become the solutions.

    Returns:
        The number of negative eigenvalues, counted from the pivots (Sylvester).
    """
    count, many = diagonal.shape[0], right.shape[2]
    inverse = np.empty((count, 3, 3))
    carry = np.empty((count, 3, 3))  # D^-1 U
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
                    right[i, r, k] -= g[0, r] * right[i - 1, 0, k] + g[1, r] * right[i - 1, 1, k] + g[2, r] * right[i - 1, 2, k]
        negative += invert(block, inverse[i])
        for r in range(3):
            for c in range(3):
                carry[i, r, c] = inverse[i, r, 0] * upper[i, 0, c] + inverse[i, r, 1] * upper[i, 1, c] + inverse[i, r, 2] * upper[i, 2, c]
    for i in range(count - 1, -1, -1):
        d = inverse[i]
        for k in range(many):
            x, y, z = right[i, 0, k], right[i, 1, k], right[i, 2, k]
            for r in range(3):
                value = d[r, 0] * x + d[r, 1] * y + d[r, 2] * z
                if i + 1 < count:
                    value -= carry[i, r, 0] * right[i + 1, 0, k] + carry[i, r, 1] * right[i + 1, 1, k] + carry[i, r, 2] * right[i + 1, 2, k]
                right[i, r, k] = value
    return negative


@kernel
def invert(block, out):  # type: ignore[no-untyped-def]
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
    scale = 1.0 / det
    out[0, 0], out[0, 1], out[0, 2] = (d * f - e * e) * scale, x * scale, y * scale
    out[1, 0], out[1, 1], out[1, 2] = x * scale, (a * f - c * c) * scale, (b * c - a * e) * scale
    out[2, 0], out[2, 1], out[2, 2] = y * scale, (b * c - a * e) * scale, minor * scale
    return (1 if a < 0 else 0) + (1 if minor / a < 0 else 0) + (1 if det / minor < 0 else 0)


@kernel
def work_of(diagonal, upper, beyond, turn):  # type: ignore[no-untyped-def]
    """Curvature turn . H turn [J] along turns (n-1, 3); `beyond` may be empty."""
    total, count = 0.0, len(turn)
    for j in range(count):
        for r in range(3):
            value = 0.0
            for c in range(3):
                value += diagonal[j, r, c] * turn[j, c]
                if j + 1 < count:
                    value += 2.0 * upper[j, r, c] * turn[j + 1, c]
                if j + 2 < count and len(beyond) > 0:
                    value += 2.0 * beyond[j, r, c] * turn[j + 2, c]
            total += turn[j, r] * value
    return total
