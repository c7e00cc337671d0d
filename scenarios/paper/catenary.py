"""The catenary in closed form, to tell whether a part of a recorded cable is one.

With the horizontal pull H and the weight w per length, a = H / w:  z = a cosh((x - x0) / a) + c. Two places of it give x0 and c.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from protocol.messages import Frame


def misses(frame: Frame, weight: float, cable: int = 0) -> list[tuple[float, float]]:
    """Horizontal pull [N] of every part between held places, and how far [m] its nodes are off the catenary of that pull.

    Args:
        frame: Of a cable in the x-z plane, with a hinge at its first node, and touched nowhere.
        weight: [N/m] Of the cable.
        cable: Its index.
    """
    return [(pull, miss(nodes, pull / weight)) for pull, nodes in _parts(frame, cable)]


def miss(nodes: np.ndarray, a: float) -> float:
    """How far [m] nodes (n, 3) are above or below the catenary of parameter a [m] through the first and the last of them."""
    x, z = nodes[:, 0], nodes[:, 2]
    across, rise = x[-1] - x[0], z[-1] - z[0]
    lowest = 0.5 * (x[0] + x[-1]) - a * np.arcsinh(rise / (2 * a * np.sinh(across / (2 * a))))
    return float(np.abs(a * (np.cosh((x - lowest) / a) - np.cosh((x[0] - lowest) / a)) + z[0] - z).max())


def _parts(frame: Frame, cable: int) -> Iterator[tuple[float, np.ndarray]]:
    """Pull [N] and nodes of every part: what the places up to there pull at the cable, along x."""
    shape = frame.shapes[cable]
    pulls = -np.cumsum(shape.grasp_wrenches[:, 0])
    ends = [int(np.argmin(np.abs(shape.s - s))) for s in frame.grasps[cable].s]
    for pull, (first, last) in zip(pulls.tolist(), pairwise(ends), strict=False):
        yield pull, shape.nodes[first : last + 1]
