"""Twist: torque GJ times the rate of turn of the section about the tangent.

Energy GJ/2 kappa_3^2 per metre (Saint-Venant; Antman 2005, "Nonlinear Problems of Elasticity", ch. 8). Warping is left
out; it vanishes for a round section.
"""

from __future__ import annotations

import numpy as np

from protocol.scene import Cable

from ..mesh import Mesh


def stiffness(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Share of the diagonal law of every segment for (curvature, curvature, twist), (n-1, 3) [N m^2]."""
    out = np.zeros((len(mesh.lengths), 3))
    out[:, 2] = mesh.along(cable, "twist")
    return out
