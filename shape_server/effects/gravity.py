"""Gravity: the weight of the cable, a load along it.

f = m' g in N per metre of cable, m' the mass per length and g the acceleration of gravity. Lumped to the nodes with half
of each neighbouring segment, which is the exact work of a straight segment's weight. Buoyancy is left out.
"""

from __future__ import annotations

import numpy as np

from protocol.messages import Problem
from protocol.scene import Vector

from ..mesh import Mesh


def node_loads(problem: Problem, gravity: Vector, mesh: Mesh) -> np.ndarray:
    """Weight at every node, (n, 3) [N].

    Args:
        problem: Its cable gives the mass per length [kg/m].
        gravity: [m/s^2].
        mesh: The nodes.
    """
    half = 0.5 * mesh.lengths * mesh.along(problem.cable, "mass_per_length")
    share = np.zeros(len(mesh.s))
    share[:-1] += half
    share[1:] += half
    return np.outer(share, gravity)
