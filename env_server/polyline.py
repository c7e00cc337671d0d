"""Places on the polyline of a cable."""

from __future__ import annotations

import numpy as np

from protocol.messages import Shape


def points_at(shape: Shape, s: np.ndarray) -> np.ndarray:
    """Points (p, 3) [m] of the axis at arc lengths s (p,) [m]."""
    return np.column_stack([np.interp(s, shape.s, column) for column in shape.nodes.T])
