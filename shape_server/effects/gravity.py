"""Gravity: the weight of the cable, a load along it.

f = m' g in N per metre of cable, m' the mass per length and g the acceleration of gravity. Lumped to the nodes with half
of each neighbouring segment, which is the exact work of a straight segment's weight. Buoyancy and added parts are left
out.
"""

from __future__ import annotations

import numpy as np

from protocol.scene import Cable, Vector


def node_loads(lengths: np.ndarray, cable: Cable, gravity: Vector) -> np.ndarray:
    """Weight at every node, (n, 3) [N].

    Args:
        lengths: (n-1,) [m] Length of every segment.
        cable: Gives the mass per length [kg/m].
        gravity: [m/s^2].
    """
    share = np.zeros(len(lengths) + 1)
    share[:-1] += 0.5 * lengths
    share[1:] += 0.5 * lengths
    return np.outer(share, cable.mass_per_length * np.asarray(gravity))
