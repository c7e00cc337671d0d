"""Places on the polyline of a cable."""

from __future__ import annotations

import numpy as np

from protocol.messages import Shape


def points_at(shape: Shape, s: np.ndarray) -> np.ndarray:
    """Points (p, 3) [m] of the axis at arc lengths s (p,) [m]."""
    return np.column_stack([np.interp(s, shape.s, column) for column in shape.nodes.T])


def smooth_at(shape: Shape, s: np.ndarray) -> np.ndarray:
    """Points (p, 3) [m] at arc lengths s (p,) [m] of the quadratic B-spline of the nodes, the axis on which cables touch each other.

    It touches every segment at its middle, and half a segment at both ends is straight.
    """
    last = len(shape.s) - 1
    place = np.interp(s, shape.s, np.arange(last + 1))
    node = np.clip(np.round(place).astype(int), 1, last - 1)
    t = (place - node)[:, None]
    curve = 0.5 * (0.5 - t) ** 2 * shape.nodes[node - 1] + (0.75 - t * t) * shape.nodes[node] + 0.5 * (0.5 + t) ** 2 * shape.nodes[node + 1]
    return np.where((np.abs(t) <= 0.5), curve, points_at(shape, s))
