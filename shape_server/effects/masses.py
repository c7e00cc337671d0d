"""Masses: connectors, clips and grommets that hang on the cable at one point each.

A mass M at arc length s adds the force M g there, shared by the two nodes of its segment; its size is left out.

Its size: a force P moves a string of tension T and span L by P L / 4 T, a beam by P L^3 / 48 EI, and both together by
P / (4 T / L + 48 EI / L^3) (Timoshenko 1955, "Strength of Materials", part II, ch. 2); a tail by P / (T / L + 3 EI / L^3).
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from protocol.messages import PointLoads, Problem
from protocol.scene import Cable, Vector

from ..mesh import Mesh
from ..seen import Seen, Size

MARGIN: Final = 1.5  # times the formula


def node_loads(cable: Cable, loads: PointLoads | None, gravity: Vector, mesh: Mesh) -> np.ndarray:
    """Weight of the lumped masses at every node, (n, 3) [N]."""
    at, mass = [mass.at for mass in cable.masses], [mass.mass for mass in cable.masses]
    return mesh.shared(np.array(at), np.outer(mass, gravity))


def size(problem: Problem, gravity: Vector, seen: Seen) -> Size:
    """What leaving the lumped masses out could change."""
    pull = math.hypot(*gravity)
    weights = [(mass.at, mass.mass * pull) for mass in problem.cable.masses]
    moved = min(MARGIN * sum(seen.pushed(at, weight) for at, weight in weights), problem.cable.length)
    felt = seen.moved(moved)
    return Size(moved, felt.force + sum(weight for _, weight in weights), felt.curvature)
