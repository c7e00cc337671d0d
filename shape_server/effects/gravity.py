"""Gravity: the weight of the cable, a load along it.

f = m' g in N per metre of cable, m' the mass per length and g the acceleration of gravity. Lumped to the nodes with half
of each neighbouring segment, which is the exact work of a straight segment's weight. Buoyancy is left out.

Its size: half of a span's weight in its middle, as that of `masses`. It is never left out by its size, for that saves nothing, and of two
shapes that are alike without gravity it decides for one.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from protocol.messages import PointLoads, Problem
from protocol.scene import Cable, Vector

from ..mesh import Mesh
from ..seen import Seen, Size

MARGIN: Final = 1.5  # times the formula, as for masses


def node_loads(cable: Cable, loads: PointLoads | None, gravity: Vector, mesh: Mesh) -> np.ndarray:
    """Weight at every node, (n, 3) [N].

    Args:
        cable: Gives the mass per length [kg/m].
        loads: Not looked at.
        gravity: [m/s^2].
        mesh: The nodes.
    """
    half = 0.5 * mesh.lengths * mesh.along(cable, "mass_per_length")
    share = np.zeros(len(mesh.s))
    share[:-1] += half
    share[1:] += half
    return np.outer(share, gravity)


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving gravity out could change."""
    moved = 0.0
    for span in seen.spans:
        weight = float(seen.weight[span.first : span.last].sum())
        middle = float(0.5 * (seen.mesh.s[span.first] + seen.mesh.s[span.last]))
        moved = max(moved, min(MARGIN * seen.pushed(middle, 0.5 * weight), span.length))
    felt = seen.moved(moved)
    return Size(moved, felt.force + float(seen.weight.sum()), felt.curvature)
