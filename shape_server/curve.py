"""Smooth curves of a given length, and frames along them without twist, compiled."""

from __future__ import annotations

import numpy as np

from .jitted import kernel

POINTS = 121  # of a curve, to measure its length and to cut it into equal shares
SAG_MOST = 64.0  # of the length
ROUNDS = 40
CLOSE = 1e-13  # of the length, to which a curve has its length


@kernel
def sagging_tangents(start, end, first, last, down, length, pull, fractions):  # type: ignore[no-untyped-def]
    """Chord directions (n-1, 3) between the points at shares `fractions` (n,) of a curve that is `length` long.

    A cubic Hermite curve with end tangents of the length `pull`. What it lacks in length it hangs down, by
    u^2 (1 - u)^2, which leaves the end tangents as they are; if it is too long, its tangents are made shorter.

    Args:
        start: (3,) [m].
        end: (3,) [m].
        first: (3,) unit tangent at the start.
        last: (3,) unit tangent at the end.
        down: (3,) unit direction to hang in.
        length: [m].
        pull: [m] Length of the end tangents; their share of `length` decides how far the curve goes their way.
        fractions: (n,) from 0 to 1, growing.
    """
    points = np.empty((POINTS, 3))
    ends = (start, end, first, last, down)
    straight = _excess(ends, pull, 0.0, length, points)
    sags = straight < 0.0
    low, high = 0.0, SAG_MOST * length if sags else pull
    short = straight if sags else _excess(ends, 0.0, 0.0, length, points)
    long = _excess(ends, pull, high, length, points) if sags else straight
    side, middle = 0, low if short >= 0.0 else high
    for _ in range(ROUNDS):  # false position after Illinois
        if short < 0.0 < long:
            middle = (low * long - high * short) / (long - short)
        excess = _excess(ends, pull, middle, length, points) if sags else _excess(ends, middle, 0.0, length, points)
        if abs(excess) <= CLOSE * length or not short < 0.0 < long:
            break
        if excess < 0.0:
            low, short = middle, excess
            long *= 0.5 if side < 0 else 1.0
            side = -1
        else:
            high, long = middle, excess
            short *= 0.5 if side > 0 else 1.0
            side = 1
    return _chords(points, fractions)


@kernel
def _excess(ends, pull, sag, length, points):  # type: ignore[no-untyped-def]
    """Length of the curve less `length` [m]; fills in its points."""
    start, end, first, last, down = ends
    total = -length
    for i in range(POINTS):
        u = i / (POINTS - 1)
        h00, h01 = (2 * u - 3) * u * u + 1, (3 - 2 * u) * u * u
        h10, h11 = ((u - 2) * u + 1) * u, (u - 1) * u * u
        hang = 16.0 * sag * (u * (1.0 - u)) ** 2
        square = 0.0
        for k in range(3):
            points[i, k] = h00 * start[k] + h01 * end[k] + pull * (h10 * first[k] + h11 * last[k]) + hang * down[k]
            if i > 0:
                square += (points[i, k] - points[i - 1, k]) ** 2
        total += np.sqrt(square)
    return total


@kernel
def _chords(points, fractions):  # type: ignore[no-untyped-def]
    """Directions (n-1, 3) from one point to the next at given shares of the arc of a polygon."""
    arc = np.zeros(POINTS)
    for i in range(1, POINTS):
        d0, d1, d2 = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1], points[i, 2] - points[i - 1, 2]
        arc[i] = arc[i - 1] + np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    out, before, here, at = np.empty((len(fractions) - 1, 3)), points[0].copy(), np.empty(3), 0
    for j in range(1, len(fractions)):
        goal = fractions[j] * arc[-1]
        while at < POINTS - 2 and arc[at + 1] < goal:
            at += 1
        share = min(max((goal - arc[at]) / max(arc[at + 1] - arc[at], 1e-300), 0.0), 1.0)
        size = 0.0
        for k in range(3):
            here[k] = points[at, k] + share * (points[at + 1, k] - points[at, k])
            size += (here[k] - before[k]) ** 2
        size = np.sqrt(size)
        for k in range(3):
            out[j - 1, k] = (here[k] - before[k]) / max(size, 1e-300)
            before[k] = here[k]
    return out


@kernel
def frames_along(tangents, seed, node):  # type: ignore[no-untyped-def]
    """Frames (n-1, 4) along unit tangents (n-1, 3) without twist, starting from the frame `seed` (4,) at a node."""
    out = np.empty((len(tangents), 4))
    frame = seed
    for j in range(node, len(tangents)):
        frame = turn_onto(frame, tangents[j])
        out[j] = frame
    frame = seed
    for j in range(node - 1, -1, -1):
        frame = turn_onto(frame, tangents[j])
        out[j] = frame
    return out


@kernel
def turn_onto(frame, tangent):  # type: ignore[no-untyped-def]
    """The frame (4,) turned by the shortest rotation that brings its third director onto `tangent`."""
    fx, fy, fz, fw = frame[0], frame[1], frame[2], frame[3]
    a0, a1, a2 = 2 * (fx * fz + fy * fw), 2 * (fy * fz - fx * fw), 1 - 2 * (fx * fx + fy * fy)
    t0, t1, t2 = tangent[0], tangent[1], tangent[2]
    w = 1.0 + a0 * t0 + a1 * t1 + a2 * t2
    x, y, z = a1 * t2 - a2 * t1, a2 * t0 - a0 * t2, a0 * t1 - a1 * t0
    if w < 1e-12:  # straight back: half a turn about the frame's own first director
        x, y, z, w = 1 - 2 * (fy * fy + fz * fz), 2 * (fx * fy + fz * fw), 2 * (fx * fz - fy * fw), 0.0
    out = np.empty(4)
    out[0] = w * fx + x * fw + y * fz - z * fy
    out[1] = w * fy - x * fz + y * fw + z * fx
    out[2] = w * fz + x * fy - y * fx + z * fw
    out[3] = w * fw - x * fx - y * fy - z * fz
    return out / np.sqrt((out * out).sum())
