"""Loads: forces given at points of the cable, fixed in the world frame (dead loads).

A force P at arc length s does the work P . r(s); it is shared by the two nodes of its segment. Forces that turn with the cable
(follower loads) have no energy and are left out.

Its size: as that of `masses`, with the force given.
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
    """The given forces at every node, (n, 3) [N]."""
    assert loads is not None
    return mesh.shared(loads.s, loads.force)


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving the point loads out could change."""
    assert problem.loads is not None
    force = np.linalg.norm(problem.loads.force, axis=1)
    each = zip(problem.loads.s.tolist(), force.tolist(), strict=True)
    moved = min(MARGIN * sum(seen.pushed(at, load) for at, load in each), problem.cable.length)
    felt = seen.moved(moved)
    return Size(moved, felt.force + float(force.sum()), felt.curvature)
