"""Gravity: the weight of the cable, a load along it.

f = m' g in N per metre of cable, m' the mass per length and g the acceleration of gravity. Lumped to the nodes with half
of each neighbouring segment, which is the exact work of a straight segment's weight. Buoyancy is left out.
"""

from __future__ import annotations

import numpy as np

from protocol.messages import PointLoads
from protocol.scene import Cable, Vector

from ..mesh import Mesh


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
