"""Kernels of the chain of segments: directors, positions and carried forces of the frames, and how frames are turned."""

from __future__ import annotations

import numpy as np

from .jitted import kernel

SHORT = 0.01  # squared half turn below which five terms of the series of sine and cosine are exact to rounding


@kernel
def directors(frames):  # type: ignore[no-untyped-def]
    """Directors of every segment: (n-1, 3, 3), rows d1, d2, d3."""
    count = frames.shape[0]
    out = np.empty((count, 3, 3))
    for j in range(count):
        x, y, z, w = frames[j, 0], frames[j, 1], frames[j, 2], frames[j, 3]
        out[j, 0, 0], out[j, 0, 1], out[j, 0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)
        out[j, 1, 0], out[j, 1, 1], out[j, 1, 2] = 2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)
        out[j, 2, 0], out[j, 2, 1], out[j, 2, 2] = 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)
    return out


@kernel
def positions(tangents, lengths, base, origin):  # type: ignore[no-untyped-def]
    """Nodes (n, 3) from the tangents (n-1, 3), with node `base` at `origin`."""
    count = lengths.shape[0]
    out = np.empty((count + 1, 3))
    out[base] = origin
    for j in range(base, count):
        for k in range(3):
            out[j + 1, k] = out[j, k] + lengths[j] * tangents[j, k]
    for j in range(base - 1, -1, -1):
        for k in range(3):
            out[j, k] = out[j + 1, k] - lengths[j] * tangents[j, k]
    return out


@kernel
def carried_forces(forces, base):  # type: ignore[no-untyped-def]
    """Force that each segment hands towards the base: (n-1, 3) from the node forces (n, 3)."""
    count = forces.shape[0] - 1
    out = np.empty((count, 3))
    for k in range(3):
        total = 0.0
        for j in range(count - 1, base - 1, -1):
            total += forces[j + 1, k]
            out[j, k] = total
        total = 0.0
        for j in range(base):
            total -= forces[j, k]
            out[j, k] = total
    return out


@kernel
def retract(frames, turn):  # type: ignore[no-untyped-def]
    """Frames turned by the rotation vectors `turn` (n-1, 3) in their own axes, with unit length."""
    out = np.empty_like(frames)
    for j in range(frames.shape[0]):
        t0, t1, t2 = 0.5 * turn[j, 0], 0.5 * turn[j, 1], 0.5 * turn[j, 2]
        q = t0 * t0 + t1 * t1 + t2 * t2
        if q < SHORT:
            s = 1.0 - q * (1 / 6 - q * (1 / 120 - q * (1 / 5040 - q / 362880)))
            bw = 1.0 - q * (1 / 2 - q * (1 / 24 - q * (1 / 720 - q / 40320)))
        else:
            angle = np.sqrt(q)
            s, bw = np.sin(angle) / angle, np.cos(angle)
        bx, by, bz = s * t0, s * t1, s * t2
        ax, ay, az, aw = frames[j, 0], frames[j, 1], frames[j, 2], frames[j, 3]
        x = aw * bx + ax * bw + ay * bz - az * by
        y = aw * by - ax * bz + ay * bw + az * bx
        z = aw * bz + ax * by - ay * bx + az * bw
        w = aw * bw - ax * bx - ay * by - az * bz
        scale = 1.0 / np.sqrt(x * x + y * y + z * z + w * w)
        out[j, 0], out[j, 1], out[j, 2], out[j, 3] = scale * x, scale * y, scale * z, scale * w
    return out


@kernel
def interpolate_frames(there, frames, here):  # type: ignore[no-untyped-def]
    """Frames (m, 4) at the arc lengths `here` (m,) from the frames (n, 4) at `there` (n,): cubic through the four nearest.

    Both are in growing order. With fewer than four frames the polynomial is of as high an order as they allow.
    """
    return blend_frames(frames, *cubic_weights(there, here))


@kernel
def cubic_weights(there, here):  # type: ignore[no-untyped-def]
    """For every place `here` (m,): the first (m,) of the four nearest places `there` (n,), and the weights of these four (m, 4).

    Both are in growing order; of fewer than four places there are as many weights.
    """
    count, many = len(there), len(here)
    width = min(4, count)
    nearest, weights = np.empty(many, dtype=np.int64), np.ones((many, width))
    at = 0
    for i in range(many):
        while at + 1 < count and there[at + 1] <= here[i]:
            at += 1
        first = min(max(at - 1, 0), count - width)
        nearest[i] = first
        for a in range(width):
            for b in range(width):
                if b != a:
                    weights[i, a] *= (here[i] - there[first + b]) / (there[first + a] - there[first + b])
    return nearest, weights


@kernel
def blend_frames(frames, nearest, weights):  # type: ignore[no-untyped-def]
    """Unit quaternions (m, 4) from the frames (n, 4), of which each is blended from some in line, whichever sign these have."""
    many, width = weights.shape
    out, aligned = np.empty((many, 4)), frames.copy()
    for j in range(1, len(frames)):
        dot = 0.0
        for k in range(4):
            dot += aligned[j, k] * aligned[j - 1, k]
        if dot < 0.0:
            for k in range(4):
                aligned[j, k] = -aligned[j, k]
    for i in range(many):
        size = 0.0
        for k in range(4):
            out[i, k] = 0.0
        for a in range(width):
            for k in range(4):
                out[i, k] += weights[i, a] * aligned[nearest[i] + a, k]
        for k in range(4):
            size += out[i, k] * out[i, k]
        size = 1.0 / np.sqrt(max(size, 1e-300))
        for k in range(4):
            out[i, k] *= size
    return out


@kernel
def combined_nodes(coarse, fine):  # type: ignore[no-untyped-def]
    """Nodes (n, 3) [m] of fourth order from those of two meshes, (n, 3) and (2n-1, 3), and their largest distance [m]; see `richardson`."""
    out, apart = np.empty_like(coarse), 0.0
    for i in range(len(coarse)):
        size = 0.0
        for k in range(3):
            difference = fine[2 * i, k] - coarse[i, k]
            out[i, k] = fine[2 * i, k] + difference / 3.0
            size += difference * difference
        apart = max(apart, np.sqrt(size))
    return out, apart
