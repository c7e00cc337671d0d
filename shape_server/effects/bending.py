"""Bending: moment EI times curvature, about one axis of the section or with a stiffness of its own about each.

Energy (EI_1 kappa_1^2 + EI_2 kappa_2^2) / 2 per metre (Euler-Bernoulli; Antman 2005, "Nonlinear Problems of Elasticity",
ch. 8); EI_2 = EI_1 for a round section. Shear and the slip of wires inside a bundle are left out; a bundle of loose wires is
softer than its bonded section by a factor that the scene's number must already hold.
"""

from __future__ import annotations

import numpy as np

from protocol.scene import Cable

from ..mesh import Mesh


def stiffness(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Share of the diagonal law of every segment for (curvature, curvature, twist), (n-1, 3) [N m^2]."""
    out = np.zeros((len(mesh.lengths), 3))
    out[:, 0] = mesh.along(cable, "bending")
    out[:, 1] = out[:, 0] if cable.bending_2 is None else mesh.along(cable, "bending_2")
    return out
