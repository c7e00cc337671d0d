"""MoorPy: the catenary in closed form with an elastic line and a seabed; no bending, so it takes part in the hanging cable only.

`catenary` returns positions when it is asked to plot. CB < 0 tells the depth of a seabed that is out of reach. Its tolerance of 1e-6 m
on the ends and EA decide the error: 1.7e-6 of the length at EA = 1e6 N, 8e-8 at 1e9 N, in the same time.
"""

from __future__ import annotations

import numpy as np

from .motions import Hanging

NAME = "MoorPy catenary"
DISTRIBUTION, VERSION = "MoorPy", (1, 3)
INSTALL = "Install it with pip install 'MoorPy>=1.3'."
AXIAL = 1e9  # N, EA


def hang(hanging: Hanging, span: float, rise: float = 0.0) -> np.ndarray:
    """Nodes (n, 3) [m] from the origin to a point a span away and so much higher."""
    from moorpy.Catenary import catenary

    info = catenary(span, rise, hanging.length, AXIAL, hanging.weight, CB=-10 * hanging.length, plots=1, nNodes=hanging.nodes)[-1]
    return np.column_stack([info["X"], np.zeros(hanging.nodes), info["Z"]])
