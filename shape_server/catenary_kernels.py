"""Compiled kernel of the rigid catenary: arrays in, arrays out, in three microseconds for a hundred nodes.

The same formulas in the same order as `hang` in `catenary.py`, where they are derived and where all that surrounds them
(forces at the ends, curvature, the elastic cable) is found; the tests hold the two together.
"""

from __future__ import annotations

import math

import numpy as np

from .jitted import kernel

TAUT = 1e-12  # as in catenary.py
FOLDED = 1e-12


@kernel
def hanging_nodes(start, end, length, load, s):  # type: ignore[no-untyped-def]
    """Nodes and tension of a rigid cable that hangs between two points.

    Args:
        start: (3,) m.
        end: (3,) m, no further from `start` than `length`.
        length: [m].
        load: (3,) [N/m] Weight per metre, not zero.
        s: (n,) [m] Arc lengths asked for.

    Returns:
        nodes (n, 3) [m] and tension (n,) [N].
    """
    weight = math.sqrt(load[0] * load[0] + load[1] * load[1] + load[2] * load[2])
    u0, u1, u2 = -load[0] / weight, -load[1] / weight, -load[2] / weight
    c0, c1, c2 = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    rise = c0 * u0 + c1 * u1 + c2 * u2
    a0, a1, a2 = c0 - rise * u0, c1 - rise * u1, c2 - rise * u2
    span = math.sqrt(a0 * a0 + a1 * a1 + a2 * a2)
    if span > 0.0:
        a0, a1, a2 = a0 / span, a1 / span, a2 / span
    horizontal, first = _end_forces(span, rise, math.sqrt(c0 * c0 + c1 * c1 + c2 * c2), length, weight)
    first_tension = math.sqrt(horizontal * horizontal + first * first)
    count = len(s)
    nodes, tension = np.empty((count, 3)), np.empty(count)
    apart = np.empty(count)  # sinh of the difference between the parameters of a node and of the first end
    square, inverse = horizontal * horizontal, 1.0 / max(horizontal * horizontal, 1e-300)
    for i in range(count):  # without branch or call, so that LLVM turns it into vector instructions
        vertical = first + weight * s[i]
        pull = math.sqrt(square + vertical * vertical)
        tension[i] = pull
        below = vertical * first_tension + first * pull
        same_side = weight * s[i] * (vertical + first) / (below if below != 0.0 else 1.0)
        apart[i] = same_side if vertical * first > 0.0 else (vertical * first_tension - first * pull) * inverse
    for i in range(count):
        x = horizontal / weight * _asinh(apart[i]) if horizontal > 0.0 else 0.0
        y = s[i] * (2.0 * first + weight * s[i]) / max(tension[i] + first_tension, 1e-300)
        nodes[i, 0] = start[0] + x * a0 + y * u0
        nodes[i, 1] = start[1] + x * a1 + y * u1
        nodes[i, 2] = start[2] + x * a2 + y * u2
    return nodes, tension


@kernel
def _asinh(x):  # type: ignore[no-untyped-def]
    """asinh, half as long as that of the C library where no digits can be lost."""
    size = abs(x)
    if size < 0.5:
        return math.asinh(x)
    return math.copysign(math.log(size + math.sqrt(size * size + 1.0)), x)


@kernel
def _end_forces(span, rise, chord, length, weight):  # type: ignore[no-untyped-def]
    """Horizontal force, and vertical force at the first end [N]."""
    if span < FOLDED * length:
        return 0.0, -0.5 * weight * (length - rise)
    left = max(length - chord, TAUT * length) * (length + chord)
    root = math.sqrt(left + span * span)
    u = parameter(left / (span * (span + root)))
    horizontal = weight * span / (2.0 * u)
    return horizontal, horizontal * math.sinh(math.asinh(rise / root) - u)


@kernel
def parameter(excess):  # type: ignore[no-untyped-def]
    """Positive x with sinh(x) / x = 1 + excess."""
    x = math.sqrt(6.0 * excess) if excess < 3.0 else math.log(2.0 * (1.0 + excess) * math.log(2.0 * (1.0 + excess)))
    goal = math.log1p(excess)
    for _ in range(60):
        grown, over = sinh_over(x)
        step = x * (math.log1p(grown) - goal) / over
        x -= min(step, 0.5 * x)
        if abs(step) < 1e-15 * x:
            break
    return x


@kernel
def sinh_over(u):  # type: ignore[no-untyped-def]
    """The pair sinh(u)/u - 1 and u coth(u) - 1, without cancellation."""
    if u > 1.0:
        return math.sinh(u) / u - 1.0, u / math.tanh(u) - 1.0
    term, grown, difference = 1.0, 0.0, 0.0
    for j in range(2, 22, 2):
        term *= u * u / (j * (j + 1))
        grown += term
        difference += j * term
    return grown, difference / (1.0 + grown)
