"""The catenary: a cable without bending, hanging between points where it is held, in closed form.

Between two points at horizontal distance d and height v, a cable of length L and weight w per metre hangs as
y = a cosh((u - u0) / a), with the horizontal force H = w a. The one unknown x = d / 2a solves

    sinh(x) / x = sqrt(L^2 - v^2) / d

and everything else follows (Irvine 1981, "Cable Structures", ch. 1). Inextensible; moments are left out, which moves a
cable that bends by 1.2 sqrt(EI / T) beside a clamp. Tails beyond the outermost held points hang straight down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

TAUT = 1e-12  # of the length; with less slack the piece is a straight line


@dataclass(frozen=True)
class Piece:
    """One hanging piece of cable at given arc lengths from its first end."""

    nodes: np.ndarray  # (n, 3) m
    tension: np.ndarray  # (n,) N
    start_force: np.ndarray  # (3,) N, on the piece at its first end
    end_force: np.ndarray  # (3,) N, on the piece at its last end
    curvature: np.ndarray  # (n,) 1/m


def hang(start: np.ndarray, end: np.ndarray, length: float, load: np.ndarray, s: np.ndarray) -> Piece:
    """The shape of a piece between two points.

    Args:
        start: (3,) m.
        end: (3,) m, no further from `start` than `length`.
        length: [m].
        load: (3,) [N/m] Weight per metre, not zero.
        s: (n,) [m] Arc lengths asked for.
    """
    weight = float(np.linalg.norm(load))
    up = -load / weight
    chord = end - start
    rise = float(chord @ up)
    across = chord - rise * up
    span = float(np.linalg.norm(across))
    if span < 1e-9 * length:
        return _fold(start, rise, length, weight, up, s)
    side = across / span
    chord_size = float(np.linalg.norm(chord))
    slack = max(length - chord_size, TAUT * length)
    root = math.sqrt(max(length - abs(rise), 0.0) * (length + abs(rise)))
    a = span / (2 * parameter(slack * (length + chord_size) / (span * (span + root))))
    lean = math.asinh(rise / root)  # atanh(rise / length), exact near 1
    first = math.sinh(lean - span / (2 * a))
    slope = first + s / a
    root0 = math.sqrt(1 + first * first)
    root1 = np.sqrt(1 + slope * slope)
    u = a * (np.arcsinh(slope) - math.asinh(first))
    y = s * (slope + first) / (root1 + root0)  # a (root1 - root0) without cancellation
    nodes = start + u[:, None] * side + y[:, None] * up
    tension = weight * a * root1
    last = first + length / a
    start_force = -weight * a * (side + first * up)
    end_force = weight * a * (side + last * up)
    return Piece(nodes, tension, start_force, end_force, 1 / (a * root1**2))


def parameter(excess: float) -> float:
    """Positive x with sinh(x) / x = 1 + excess, for excess > 0, by Newton's method on the logarithm."""
    x = math.sqrt(6 * excess) if excess < 3 else math.log(2 * (1 + excess) * math.log(2 * (1 + excess)))
    goal = math.log1p(excess)
    for _ in range(60):
        if x < 0.5:
            square = x * x
            value = math.log1p(square / 6 * (1 + square / 20 * (1 + square / 42 * (1 + square / 72 * (1 + square / 110)))))
            slope = x / 3 * (1 - square / 15 * (1 - 2 * square / 21 * (1 - square / 10)))
        else:
            value = x + math.log(-math.expm1(-2 * x) / (2 * x))
            slope = 1 / math.tanh(x) - 1 / x
        step = (value - goal) / slope
        x -= min(step, 0.5 * x)
        if abs(step) < 1e-15 * x:
            break
    return x


def straight(start: np.ndarray, end: np.ndarray, length: float, s: np.ndarray) -> np.ndarray:
    """Nodes (n, 3) of a taut piece."""
    return start + np.outer(s / length, end - start)


def _fold(start: np.ndarray, rise: float, length: float, weight: float, up: np.ndarray, s: np.ndarray) -> Piece:
    """The piece between two points one above the other: straight down to the fold, straight up again."""
    down = 0.5 * (length - rise)
    height = np.abs(s - down) - down
    tension = weight * np.abs(s - down)
    return Piece(start + np.outer(height, up), tension, weight * down * up, weight * (length - down) * up, np.zeros(len(s)))
