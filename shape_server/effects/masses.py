"""Masses: connectors, clips and grommets that hang on the cable at one point each.

A mass M at arc length s adds the force M g there, shared by the two nodes of its segment; its size is left out.
"""

from __future__ import annotations

import numpy as np

from protocol.messages import PointLoads
from protocol.scene import Cable, Vector

from ..mesh import Mesh


def node_loads(cable: Cable, loads: PointLoads | None, gravity: Vector, mesh: Mesh) -> np.ndarray:
    """Weight of the lumped masses at every node, (n, 3) [N]."""
    at, mass = [mass.at for mass in cable.masses], [mass.mass for mass in cable.masses]
    return mesh.shared(np.array(at), np.outer(mass, gravity))
