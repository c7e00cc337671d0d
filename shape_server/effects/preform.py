"""Preform: the curvature and twist that a cable has free of any load, from its spool or because it was bent beforehand.

Energy (kappa - kappa_0) . K (kappa - kappa_0) / 2 per metre, kappa_0 about d1, d2 and d3 of the section (Antman 2005,
"Nonlinear Problems of Elasticity", ch. 8). Plastic bending during the motion is left out: kappa_0 is given.
"""

from __future__ import annotations

import numpy as np

from protocol.scene import Cable

from ..mesh import Mesh


def natural(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Natural curvature and twist of every segment, (n-1, 3) [1/m]."""
    return mesh.along(cable, "natural_curvature")
