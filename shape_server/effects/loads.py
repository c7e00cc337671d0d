"""Loads: forces given at points of the cable, fixed in the world frame (dead loads).

A force P at arc length s does the work P . r(s); it is shared by the two nodes of its segment. Forces that turn with the cable
(follower loads) have no energy and are left out.
"""

from __future__ import annotations

import numpy as np

from protocol.messages import PointLoads
from protocol.scene import Cable, Vector

from ..mesh import Mesh


def node_loads(cable: Cable, loads: PointLoads | None, gravity: Vector, mesh: Mesh) -> np.ndarray:
    """The given forces at every node, (n, 3) [N]."""
    assert loads is not None
    return mesh.shared(loads.s, loads.force)
