"""Masses: connectors, clips and grommets that hang on the cable at one point each.

A mass M at arc length s adds the force M g there, shared by the two nodes of its segment; its size is left out.
"""

from __future__ import annotations

import numpy as np

from protocol.messages import Problem
from protocol.scene import Vector

from ..mesh import Mesh


def node_loads(problem: Problem, gravity: Vector, mesh: Mesh) -> np.ndarray:
    """Weight of the lumped masses at every node, (n, 3) [N]."""
    masses = problem.cable.masses
    return mesh.shared(np.array([mass.at for mass in masses]), np.outer([mass.mass for mass in masses], gravity))
