"""Stretch: a segment grows by its tension over EA per metre.

Hooke's law, e = n.d3 / EA with n the force carried (Irvine 1981, "Cable Structures", ch. 1); what that adds to the system stands
in `axial`. The section keeps its size, so bending and twist stay as they are.
"""

from __future__ import annotations

import numpy as np

from protocol.scene import Cable

from ..mesh import Mesh


def give(cable: Cable, mesh: Mesh) -> np.ndarray:
    """Growth of every segment under a unit of tension, (n-1,) [m/N]."""
    return np.asarray(mesh.lengths / mesh.along(cable, "stretch"))
